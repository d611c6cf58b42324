"""One direction: what may import what, with no circle and no private name from elsewhere."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "ngswell"
FLOORS = (
    "version", "units", "errors", "meeting", "team", "calls", "checks", "files", "streams", "schedules", "histories", "mesh",
    "physics", "models", "baths", "setup", "problem", "solve", "stepping", "analysis", "observers", "run", "scene",
)  # fmt: skip
"""From the ground up: each imports only from those before it, and inside a folder no file imports in a circle."""

BESIDE = {"closed_forms": "setup", "plotting": "solve"}
"""Rooms that nothing imports, and the floor below which everything is theirs to use."""


def module(file):
    return file.relative_to(PACKAGE.parent).with_suffix("").as_posix().replace("/", ".").removesuffix(".__init__")


def imported(tree):
    """(module, names) of every import of ngswell anywhere in a file, also inside functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "ngswell":
            yield node.module, [alias.name for alias in node.names]
        elif isinstance(node, ast.Import):
            yield from ((alias.name, []) for alias in node.names if alias.name.split(".")[0] == "ngswell")


FILES = {module(file): ast.parse(file.read_text(encoding="utf-8")) for file in sorted(PACKAGE.rglob("*.py"))}


def targets(tree):
    """Modules that a file imports: `from ngswell.physics import donnan` is one of ngswell.physics.donnan."""
    for origin, names in imported(tree):
        inside = [f"{origin}.{name}" for name in names if f"{origin}.{name}" in FILES]
        yield from inside or [origin]


def floor(name):
    return name.split(".")[1] if "." in name else name


def faults(files):
    """Every import against the order, as (from, to)."""
    found = []
    for name, tree in files.items():
        mine = floor(name)
        if mine == "ngswell":
            continue
        limit = FLOORS.index(BESIDE.get(mine, mine))
        for target in targets(tree):
            theirs = floor(target)
            if theirs != mine and (theirs not in FLOORS or FLOORS.index(theirs) >= limit):
                found.append((name, target))
    return found


def circles(files):
    """Modules that import themselves by way of others."""
    graph = {name: set(targets(tree)) & set(files) for name, tree in files.items() if name != "ngswell"}
    while leaves := [name for name, to in graph.items() if not to & set(graph)]:
        for name in leaves:
            del graph[name]
    return sorted(graph)


def borrowed(files):
    """Private names taken from another module, and imports for types only."""
    for name, tree in files.items():
        for origin, names in imported(tree):
            yield from ((name, origin, taken) for taken in names if taken.startswith("_") and not taken.startswith("__"))
        yield from ((name, "typing", node.id) for node in ast.walk(tree) if getattr(node, "id", "") == "TYPE_CHECKING")


def test_every_folder_imports_only_from_those_below_it():
    assert len(FILES) > 50
    assert not faults(FILES)
    assert not circles(FILES)
    assert not list(borrowed(FILES))


def test_what_is_against_the_order_is_noticed():
    wrong = FILES | {"ngswell.physics.wrong": ast.parse("from ngswell.run.run import run, _Log\nTYPE_CHECKING")}
    assert faults(wrong) == [("ngswell.physics.wrong", "ngswell.run.run")]
    assert ("ngswell.physics.wrong", "ngswell.run.run", "_Log") in list(borrowed(wrong))
    assert ("ngswell.physics.wrong", "typing", "TYPE_CHECKING") in list(borrowed(wrong))
    turned = FILES | {"ngswell.errors": ast.parse("from ngswell.checks import short")}
    assert {"ngswell.errors", "ngswell.checks"} <= set(circles(turned))


def lengths(tree):
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node.end_lineno - node.lineno + 1, node.name


def test_no_file_and_no_function_is_long():
    files = {name: len((PACKAGE.parent / (name.replace(".", "/") + ".py")).read_text().splitlines())
             for name in FILES if (PACKAGE.parent / (name.replace(".", "/") + ".py")).exists()}  # fmt: skip
    assert {name: lines for name, lines in files.items() if lines > 250} == {}
    long = {f"{name}.{function}": lines for name, tree in FILES.items() for lines, function in lengths(tree) if lines > 50}
    assert long == {}
