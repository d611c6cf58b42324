"""The code of the README and of the first scene runs as it stands, and gives what a scene like that gives."""

import re
from pathlib import Path

import matplotlib as mpl
import pytest

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
FIRST_SCENE = ROOT / "docs" / "first_scene.md"


def blocks(page):
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def run(page, *code):
    """The names that the code of a page leaves, run block by block as one script."""
    names = {"__name__": page.stem}
    for block in code:
        exec(compile(block, str(page), "exec"), names)
    return names


def test_the_scene_of_the_readme_runs(capsys):
    (code,) = blocks(README)
    assert len(code.splitlines()) <= 12
    names = run(README, code)
    printed = capsys.readouterr().out
    assert "bath on top|left|bottom: prescribed" in printed
    assert "weight" not in printed
    assert names["result"].state.at((1.1, 0.5), "J") == pytest.approx(1.776, abs=0.01)  # the last number printed


def test_the_first_scene_runs(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = blocks(FIRST_SCENE)
    optional = [block for block in code if "import pandas" in block]
    assert len(optional) == 1
    with mpl.rc_context():
        names = run(FIRST_SCENE, *(block for block in code if block not in optional))
    compile(optional[0], "optional", "exec")  # pandas need not be there
    printed = capsys.readouterr().out
    quoted = re.findall(r"^    (\S.*)$", re.sub(r"```.*?```", "", FIRST_SCENE.read_text(encoding="utf-8"), flags=re.S), re.M)
    assert len(quoted) == 2
    assert all(line in printed for line in quoted)  # the refusals, word for word
    assert "no step succeeds after t = 0 s" in printed
    assert max(names["ledger"].imbalance().values()) < 1e-2  # the tolerance of the run
    assert {file.name for file in tmp_path.iterdir()} >= {"core.csv", "pressure.png", "swelling.pvd"}


def test_code_that_does_not_run_is_noticed():
    (code,) = blocks(README)
    with pytest.raises(NameError):
        run(README, code.replace("PlaneStrain(", "PlainStrain("))


def test_the_readme_is_short():
    text = README.read_text(encoding="utf-8")
    assert text.count("![") == 1
    assert len(text.split()) < 350
    tests = re.findall(r"^python -m pip install .*&& python -m pytest .*$", text, re.MULTILINE)
    assert len(tests) == 1  # which the continuous integration runs
