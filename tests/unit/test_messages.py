"""docs/messages.md has every exception, and every reason why a step fails with what to do."""

import inspect
import re
from pathlib import Path

import pytest

from ngswell import errors
from ngswell.errors import REMEDIES, Failure, Reason, StepError

PAGE = (Path(__file__).parents[2] / "docs" / "messages.md").read_text(encoding="utf-8")


def cells(page):
    """The cells of every row of every table."""
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in page.splitlines() if line.startswith("|")]


def missing_reasons(page, reasons=Reason):
    """Reasons without a row that has their name and words, what they mean and what to do."""
    rows = [row for row in cells(page) if len(row) == 3 and all(row)]
    for reason in reasons:
        words = [piece.strip() for piece in reason.value.split("{what}") if piece.strip()]
        if not any(f"`{reason.name}`" in row[0] and all(word in row[0] for word in words) for row in rows):
            yield reason.name


def missing_exceptions(page, names):
    """Exceptions without a row that says when they come and how things are afterwards."""
    rows = [row for row in cells(page) if len(row) == 4]
    return [name for name in names if not any(f"`{name}`" in row[0] and row[2] and row[3] for row in rows)]


EXCEPTIONS = [
    name
    for name, thing in vars(errors).items()
    if inspect.isclass(thing) and issubclass(thing, Exception) and thing.__module__ == errors.__name__
]


def test_every_reason_has_its_row_and_remedies():
    assert len(Reason) >= 10
    assert not list(missing_reasons(PAGE))
    assert set(REMEDIES) == set(Reason)
    assert all(remedy.startswith("Remedies: ") for remedy in REMEDIES.values())


def test_every_exception_is_on_the_page():
    assert len(EXCEPTIONS) >= 5
    assert not missing_exceptions(PAGE, EXCEPTIONS)


@pytest.mark.parametrize(
    ("right", "wrong", "lost"),
    [
        ("Newton's method stalls", "Newton's method gets stuck", ["STALLED"]),
        ("(`UNSTABLE`)", "", ["UNSTABLE"]),
        ("| name the kink; a larger tolerance; `Fixed` steps |", "| |", ["ERROR_ABOVE_TOLERANCE"]),
    ],
)
def test_a_reason_that_is_not_listed_is_noticed(right, wrong, lost):
    assert PAGE.count(right) == 1
    assert list(missing_reasons(PAGE.replace(right, wrong))) == lost


def test_an_exception_that_is_not_listed_is_noticed():
    assert missing_exceptions(PAGE, [*EXCEPTIONS, "WeatherError"]) == ["WeatherError"]


def test_the_sentence_of_a_step_error_is_the_one_on_the_page():
    said = str(StepError(3.0, 0.1, Failure(Reason.STALLED, "p", (1.0, 0.5))))
    pattern = re.search(r'A `StepError` reads: "(.*?)"', " ".join(PAGE.split()))[1]
    filled = re.escape(pattern).replace("…", ".*").replace("REASON", re.escape(Reason.STALLED.value))
    assert re.fullmatch(filled, said)


def test_attributes_on_the_page_are_those_of_a_step_error():
    error = StepError(3.0, 0.1, Failure(Reason.STALLED, "p", (1.0, 0.5)))
    table = PAGE.partition("What a `StepError` carries:")[2].partition("An `InstabilityError`")[0]
    named = [name for row in cells(table)[2:] for name in re.findall(r"`(\w+)`", row[0])]
    assert len(named) == 8
    assert all(hasattr(error, name) for name in named)
    assert not hasattr(error, "remedies")
