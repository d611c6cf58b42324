"""docs/messages.md lists what users can meet, with its remedy."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "messages.md").read_text(encoding="utf-8")
RAISED = {"InputError", "OutputError", "NgswellError", "StepError", "InstabilityError"}


def template(node):
    """A message with … for what is filled in; None for what is no text."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
    return None


def messages():
    """(file, line, message) of every exception with a text of its own, every warning, every reason of a failed solve."""
    for file in sorted((ROOT / "ngswell").rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            place = 1 if name in ("Outcome", "failure") else 0
            if len(node.args) > place and (name in RAISED or name == "warn" or place):
                text = template(node.args[place])
                if text is not None:
                    yield file.relative_to(ROOT).as_posix(), node.lineno, text


def listed(text):
    """Whether the page has the longest piece of a message that nothing is filled into."""
    return max(text.split("…"), key=len).strip() in PAGE


def test_every_message_is_listed_with_its_remedy():
    found = list(messages())
    assert len(found) > 100
    assert not [entry for entry in found if not listed(entry[2])]


def test_what_is_not_listed_is_noticed():
    assert not listed("the gel has evaporated: give it a lid")
