"""docs/reference.md has every argument; pages show files, modules, names and neighbours that exist."""

import importlib
import inspect
import re
from enum import Enum
from pathlib import Path

import pytest

import ngswell
from ngswell import (
    TABLE_1,
    Bath,
    Concentration,
    Confined,
    LocalDonnan,
    PlaneStrain,
    Potential,
    Ramp,
    Roller,
    Scene,
    Uncharged,
    column,
    plotting,
)
from ngswell.closed_forms import consolidation, homogeneous, linear_column, relaxation
from ngswell.models.solid_state import OUTPUT_UNITS, SolidState
from ngswell.stepping.schemes import BACKWARD_EULER, Scheme

ROOT = Path(__file__).parents[2]
REFERENCE = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
EXTEND = (ROOT / "docs" / "extend.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]

# -- arguments ---------------------------------------------------------------------------------------------------------


def described():
    """What the page describes: (name, what is called)."""
    for name in ngswell.__all__:
        thing = getattr(ngswell, name)
        words = isinstance(thing, type) and issubclass(thing, Enum)
        if callable(thing) and name != "Setup" and not words:  # Setup is described with Scene
            yield name, thing
    for method in ("run", "after", "equilibrate", "growth_factor", "state"):
        yield f"Scene.{method}", getattr(Scene, method)
    yield "state.at", SolidState.at
    yield "on_deformed_body", plotting.on_deformed_body
    yield "Picture.mirrored", plotting.Picture.mirrored
    for module in (homogeneous, consolidation, relaxation, linear_column):
        for name, thing in vars(module).items():
            public = inspect.isfunction(thing) and thing.__module__ == module.__name__ and not name.startswith("_")
            if public and name != "parameters":  # which closed forms share
                yield name, thing
    yield "LinearColumn", linear_column.LinearColumn
    for name, thing in vars(linear_column.LinearColumn).items():
        if inspect.isfunction(thing) and not name.startswith("_"):
            yield f"LinearColumn.{name}", thing


def arguments(thing):
    """(name, default as the page shows it) of the public arguments; none of protocols, which are derived from."""
    if getattr(thing, "_is_protocol", False):
        return
    try:
        parameters = inspect.signature(thing).parameters.values()
    except ValueError:  # exceptions that carry their message only
        return
    for parameter in parameters:
        if parameter.name != "self" and not parameter.name.startswith("_"):
            yield parameter.name, shown(parameter)


def shown(parameter):
    default = parameter.default
    if parameter.kind is parameter.VAR_POSITIONAL:
        return "any number"
    if default is parameter.empty:
        return "required"
    if isinstance(default, Scheme):
        return "`BACKWARD_EULER`" if default is BACKWARD_EULER else "`ESDIRK4`"
    if isinstance(default, Ramp):
        points = zip(default.times, default.values, strict=True)
        return f"`Ramp({', '.join(map(repr, points))})`"
    if isinstance(default, Enum):
        return f"`{default}`"
    return f"`{default.__name__}`" if inspect.isfunction(default) else f"`{default!r}`"


def rows(page, heading):
    """The cells of each table row in a section, by the first."""
    section = re.search(rf"^### `{re.escape(heading)}`\n(.*?)(?=^##|\Z)", page, re.MULTILINE | re.DOTALL)
    if section is None:
        return {}
    cells = (
        [cell.strip() for cell in line.strip("| ").split(" | ")] for line in section[1].splitlines() if line.startswith("| ")
    )
    return {first.strip("`"): rest for first, *rest in cells}


def faults(page):
    """What the page lacks: arguments without a row, a unit and a meaning, with another default, and rows too many."""
    for name, thing in described():
        table, wanted = rows(page, name), dict(arguments(thing))
        for argument, default in wanted.items():
            cells = table.get(argument, [])
            if len(cells) != 3 or cells[0] != default or not all(cells):
                yield f"{name}: {argument}"
        yield from (f"{name}: {row} is no argument" for row in table if row not in {*wanted, "argument"})


def test_every_argument_has_its_unit():
    assert sum(len(dict(arguments(thing))) for _, thing in described()) > 200
    assert list(faults(REFERENCE)) == []


@pytest.mark.parametrize(
    ("right", "wrong", "fault"),
    [
        ("| `theta` | `298.0` | K |", "| `theta` | `298.0` | |", "Material: theta"),
        ("| `maxh` |", "| `size` |", "from_occ: maxh"),
        ("| `tolerance` | `0.001` |", "| `tolerance` | `0.01` |", "Adaptive: tolerance"),
        ("### `Bath`", "### `Salt`", "Bath: boundary"),
    ],
)
def test_an_argument_without_its_unit_is_noticed(right, wrong, fault):
    assert REFERENCE.count(right) == 1
    assert fault in list(faults(REFERENCE.replace(right, wrong)))


def test_every_public_name_is_on_the_page():
    assert not [name for name in ngswell.__all__ if not re.search(rf"`[^`]*\b{name}\b[^`]*`", REFERENCE)]


# -- outputs -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [Potential(), Concentration(), LocalDonnan(), Uncharged()], ids=lambda m: type(m).__name__)
def test_outputs_have_their_units_and_models(model):
    uncharged = isinstance(model, Uncharged)
    scene = Scene(
        mesh=column(0.5, 1), kinematics=Confined(), model=model, supports=[Roller("bottom", "x")],
        material=ngswell.Material(**{**vars(TABLE_1), "cfc0": 0.0}) if uncharged else TABLE_1,
        baths=[Bath("top", c=None if uncharged else 0.15)],
    )  # fmt: skip
    table = re.findall(r"^\| `(\w+)` \| (\S+(?: mm/s)?) \| (.+?) \|", REFERENCE.partition("## Outputs")[2], re.MULTILINE)
    assert {name: unit for name, unit, _ in table} == OUTPUT_UNITS
    name = f"`{type(model).__name__}`"
    given = [output for output, _, who in table if (name not in who) == who.startswith("all but") or who == "all"]
    assert set(given) == set(scene.problem.state.outputs())


# -- code, files, names ------------------------------------------------------------------------------------------------


def blocks(page):
    return re.findall(r"```python\n(.*?)```", page, re.DOTALL)


def test_the_examples_are_shown_as_they_are():
    files = {file.read_text(encoding="utf-8") for file in (ROOT / "examples").glob("extend_*.py")}
    assert len(files) == 5
    assert set(blocks(EXTEND)[:5]) == files


def test_the_short_pieces_run():
    names = {"__name__": "extend"}
    for block in blocks(EXTEND)[5:]:
        exec(compile(block, "docs/extend.md", "exec"), names)
    assert "permeability: Exponential(M=2.0)" in names["scene"].describe()
    assert names["result"].end.time == 100.0
    assert isinstance(names["scene"].kinematics, PlaneStrain)


ELSEWHERE = {"Compile", "Constant", "SystemExit"}


def stale(text, folder=ROOT / "docs"):
    """What a page names and nothing has: links, files, modules, and classes that are called."""
    for link in re.findall(r"\]\((?!http)([^)#]+)", text):
        if not (folder / link).exists():
            yield link
    for path in re.findall(r"`((?:ngswell|studies|tests|docs|examples)/[\w/.]+)`", text):
        if not (ROOT / path).exists():
            yield path
    tests = {file.name for file in (ROOT / "tests").rglob("*.py")}
    yield from (name for name in re.findall(r"`(test_\w+\.py)`", text) if name not in tests)
    for path in re.findall(r"`((?:ngswell|studies)(?:\.\w+)+)\b", text):
        if not importable(path):
            yield path
    for name in re.findall(r"`([A-Z]\w+)\(", text):
        if name not in ngswell.__all__ and name not in ELSEWHERE:
            yield name


def importable(path):
    """Whether a dotted path leads to a module or to a name in one."""
    parts = path.split(".")
    for count in range(len(parts), 0, -1):
        try:
            thing = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            if not hasattr(thing, part):
                return False
            thing = getattr(thing, part)
        return True
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_pages_name_exists(page):
    assert list(stale(page.read_text(encoding="utf-8"), page.parent)) == []


def test_what_does_not_exist_is_noticed():
    text = "[more](lost.md), `ngswell/series.py`, `tests/lost.py`, `test_lost.py`, `ngswell.analytic`, `Solid()`, `Newton()`"
    assert len(list(stale(text))) == 7
    assert not list(stale("[model](model.md), `ngswell/scene.py`, `test_scene.py`, `ngswell.closed_forms`, `Spatial()`"))
