"""Error against time: the free-swelling block by good scripts, by a plain one, by the paper's way and by ours.

Errors are against a reference (`reference.py`), whose own error a second one tells. Area: largest
error over all steps from 0 to 11000 s, relative to the area at 7000 s. Pressure: root mean square over the block at the
worst of the pictured times, relative to that of the pressure. Seconds are CPU seconds of the time loop on one
thread (the plain script's are the clock's), medians of runs that take turns (one
run beyond 10 s). For each curve NAME of the figure:

- `NAME_seconds_at_1e-2`, `..._1e-3`, `..._1e-4` [s] for that error of the area, on the line through the points that no
  other point of the curve beats in both error and time; `NAME_at_1e-2` and so on: "measured" (between points),
  "extrapolated" (beyond the most accurate, with the slope of all), "at most" (the cheapest point is already more accurate);
- `NAME_setup_seconds` [s]: mesh, spaces, forms and their compilation, observers, for the dearest point of the curve;
- `best_at_1e-2` and so on: the fastest of our curves (without the paper's way), `best_rival_at_...` the fastest of the
  others; an extrapolated time counts only where none is measured. `ratio_to_best_rival_at_...`: seconds of the latter over
  those of the former, above 1 where ours is faster; `ratio_at_..._is`: "measured" if both are, else what they are;
  `best_rival`: the one at 1e-3;
- `pressure_...`: the same of the error of the pressure; `ratio_to_plain_at_1e-2`, `..._1e-3`: plain script's over ours;
- `reference_area_error`, `reference_pressure_error`: what the two references differ by;
- `threads`: NGS_NUM_THREADS, `machine`: processor and cores;
- `penalty_40_area_error`: what the paper's penalty itself changes, on one mesh with one tolerance.

Rivals (`studies/rivals`, without ngswell): `good_ngsolve_SCHEME_MESH` and `dolfinx_SCHEME_MESH`, SCHEME `euler` or `esdirk4`
(both with control of the error and kept factorisations), MESH `uniform` (order 2) or `graded` (order 3). `--dolfinx PYTHON`
names a python that has DOLFINx; on Debian 12 /usr/bin/python3 after `apt-get install python3-dolfinx libopenblas0-pthread`.
Else `dolfinx` says that it is absent. The plain script is no part of the project: `--plain PATH` names it, or it lies in
../shared/peers beside the checkout; else `plain` says that it is absent, and its ratios are left out. `NAME_failed`: meshes
and steps with which a rival gave up.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from ngsolve import ngsglobals

from ngswell import (
    BACKWARD_EULER,
    Adaptive,
    Area,
    Concentration,
    InputError,
    Observer,
    Penalty,
    Potential,
    Problem,
    Progress,
    Result,
    Scene,
    Snapshots,
    __version__,
    rectangle,
)
from ngswell.models.model import Model
from ngswell.solve.choice import solver_of
from studies.choices import reference
from studies.choices.reference import Course, Kept, Reference
from studies.output import Findings, cost, letter_panels
from studies.rivals.block import PICTURES, SAMPLES
from studies.rivals.worker import ABSENT, Worker, add_dolfinx, machine, usable
from studies.scenes import BLENDED, END, HEIGHT, WIDTH, free_swelling_block, with_model

SCRIPT = Path(__file__).resolve().parents[3] / "shared" / "peers" / "plain_ngsolve.py"
BENDS = {"x": BLENDED, "y": BLENDED}
"""Where the blended baths bend [mm]."""

WANTED = (1e-2, 1e-3, 1e-4)
LONG = 10.0  # s
COUNTS = ("steps", "newton", "factorisations", "solves")


@dataclass(frozen=True)
class Way:
    """One way to compute the scene."""

    model: Model
    cells: int
    grade: float  # largest over smallest cell, toward the baths; beyond 1, mesh lines also lie where the baths bend
    steps: Adaptive
    penalty: float | None = None  # the paper's ε; None: the model's default
    compiled: bool = False  # terms in C++

    def scene(self) -> Scene:
        treatment = None if self.penalty is None else Penalty(self.penalty)
        grade = dict.fromkeys(("top", "left", "bottom"), self.grade)
        mesh = rectangle(WIDTH, HEIGHT, self.cells, self.cells, grade=grade, lines=BENDS if self.grade > 1 else None)
        return with_model(free_swelling_block(1, 1, mesh=mesh, compiled=self.compiled), self.model, treatment)


@dataclass(frozen=True)
class ComputedBlock(Course):
    """A run's area over time, its pressures at the pictured times, and what it cost."""

    unknowns: int
    seconds: list[float]
    setup: float = 0.0
    result: Result | None = None
    counts: dict[str, int] | None = None  # COUNTS


class Loop(Observer):
    """CPU time of the time loop alone: what runs make once, forms and their compilation, is made before it, as in rivals."""

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        vector = problem.fields.vec.CreateVector()
        problem.contents(vector)
        problem.outflow(vector)
        solver_of(problem).linearise(problem)
        self.seconds = -process_time()

    def finish(self, problem: Problem) -> None:
        self.seconds += process_time()


def compute_ours(run: Way, label: str) -> ComputedBlock:
    """One of our own runs; what is not its time loop is setup."""
    clock = sum(os.times()[:4])  # with the compilers'
    scene, loop, area, pictures = run.scene(), Loop(), Area(), Snapshots(PICTURES)
    result = scene.run(END, run.steps, [loop, area, pictures, Progress(f"speed_error {label}")])
    setup = sum(os.times()[:4]) - clock - loop.seconds
    samples = scene.mesh(*SAMPLES.T)
    pressures = np.array([scene.state(picture).output("p")(samples).ravel() for picture in pictures.states])
    return ComputedBlock(area.time, area.values, pressures, result.end.values.size, [loop.seconds], setup, result)


def compute_plain(script: Path, cells: tuple[int, int], step: float) -> ComputedBlock | None:
    """The plain script in a process of its own; None if it gives up."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "plain.json"
        command = [sys.executable, str(script), "--nx", str(cells[0]), "--ny", str(cells[1]), "--dt", str(step)]
        done = subprocess.run([*command, "--json", str(output)], capture_output=True, text=True)
        if done.returncode:  # "Newton fails at t = ... with any step"
            return None
        found = json.loads(output.read_text(encoding="utf-8"))
    history = np.array(found["history"])
    return ComputedBlock(history[:, 0], history[:, 1], None, found["ndof"], [found["seconds"]])


def compute_rival(worker: Worker, scheme: str, tolerance: float) -> ComputedBlock | None:
    """A good script's run; None if it gives up."""
    found = worker.ask(scheme, tolerance)
    if found is None:
        return None
    counts = {name: found[name] for name in COUNTS}
    time, area, pressures = (np.array(found[name]) for name in ("time", "area", "pressures"))
    return ComputedBlock(time, area, pressures, found["unknowns"], [found["seconds"]], worker.setup or 0.0, counts=counts)


@dataclass
class Curve:
    """Ways to compute the scene that differ in mesh and accuracy."""

    name: str
    label: str
    makers: Sequence[Callable[[], ComputedBlock | None]]
    settings: list[tuple[str, float]]
    courses: list[ComputedBlock] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    @property
    def rival(self) -> bool:
        """Whether it is computed without ngswell."""
        return self.name.startswith(("plain", "good_ngsolve", "dolfinx"))

    def take_turn(self) -> None:
        """Run every point once; later only those below LONG seconds, for their seconds. What fails is dropped, and said."""
        if not self.courses:
            found = [make() for make in self.makers]
            self.failed = [f"{mesh}, {at:g}" for (mesh, at), run in zip(self.settings, found, strict=True) if not run]
            kept = [number for number, course in enumerate(found) if course]
            self.makers, self.settings = [self.makers[n] for n in kept], [self.settings[n] for n in kept]
            self.courses = [course for course in found if course]
            return
        for course, make in zip(self.courses, self.makers, strict=True):
            if course.seconds[0] < LONG and (other := make()):
                course.seconds.extend(other.seconds)

    @property
    def seconds(self) -> list[float]:
        return [float(np.median(course.seconds)) for course in self.courses]

    def area_errors(self, reference: Reference) -> list[float]:
        return [reference.area_error(course) for course in self.courses]

    def pressure_errors(self, reference: Reference) -> list[float] | None:
        """None if the pressures are not known."""
        if any(course.pressures is None for course in self.courses):
            return None
        return [reference.pressure_error(course) for course in self.courses]


def seconds_at(wanted: float, errors: Sequence[float], seconds: Sequence[float]) -> tuple[float, str]:
    """Time for an error, on the line (both logarithmic) through the points that no other beats, and how it was found."""
    best: list[tuple[float, float]] = []
    for pair in sorted(zip(seconds, errors, strict=True)):
        if not best or pair[1] < best[-1][1]:
            best.append(pair)
    log_time, log_error = np.log(best).T
    target = np.log(wanted)
    if target >= log_error[0]:
        return best[0][0], "at most"
    if target >= log_error[-1]:
        return float(np.exp(np.interp(-target, -log_error, log_time))), "measured"
    slope = np.polyfit(log_error, log_time, 1)[0] if len(best) > 1 else -1.0
    return float(np.exp(log_time[-1] + slope * (target - log_error[-1]))), "extrapolated"


def through(name: str, label: str, runs: Sequence[Way]) -> Curve:
    """The curve of our own runs."""
    makers = [partial(compute_ours, run, f"{label} {run.cells}") for run in runs]
    return Curve(name, label, makers, [(f"{run.cells} x {run.cells}", run.steps.tolerance) for run in runs])


def our_curves(quick: bool) -> list[Curve]:
    """Per model, mesh family and order: meshes and tolerances that belong together."""

    def curve(name: str, model: Model, grade: float, points: Sequence[tuple[int, float]], compiled: bool = False) -> Curve:
        runs = [Way(model, cells, grade, Adaptive(tolerance), compiled=compiled) for cells, tolerance in points]
        return through(name.lower().replace(" ", "_"), name, runs)

    second = [(4, 1e-1), (6, 3e-2)] if quick else [(6, 3e-2), (8, 1e-2), (12, 3e-3), (16, 1e-3), (24, 3e-4)]
    third = [(3, 1e-1), (5, 3e-2)] if quick else [(3, 1e-1), (4, 1e-2), (6, 1e-3), (8, 1e-3), (8, 3e-4), (12, 3e-5)]
    fourth = [(2, 1e-1), (4, 3e-2)] if quick else [(3, 1e-2), (4, 1e-3), (5, 1e-3), (6, 1e-3), (6, 3e-4), (8, 3e-5)]
    uniform = [(4, 1e-1), (6, 3e-2)] if quick else [(6, 3e-2), (11, 1e-2), (22, 1e-3)]
    in_cpp = [] if quick else [curve("Potential order 3 graded compiled", Potential(3), 6.0, third, compiled=True)]
    return [
        *in_cpp,
        curve("Potential order 2 uniform", Potential(2), 1.0, uniform),
        curve("Potential order 2 graded", Potential(2), 6.0, second),
        curve("Potential order 3 graded", Potential(3), 6.0, third),
        curve("Potential order 4 graded", Potential(4), 6.0, fourth),
        curve("Concentration order 2 graded", Concentration(2), 6.0, second),
        curve("Concentration order 3 graded", Concentration(3), 6.0, third),
    ]


def paper_curve(quick: bool) -> Curve:
    """The paper's way: concentrations, its penalty, uniform cells, backward Euler (with our control of the error)."""
    points = [(4, 1e-2)] if quick else [(11, 1e-2), (16, 3e-3)]
    runs = [
        Way(Concentration(), cells, 1.0, Adaptive(tolerance, scheme=BACKWARD_EULER), 40.0) for cells, tolerance in points
    ]
    return through("paper", "as in the paper, backward Euler", runs)


def plain_curve(script: Path, quick: bool) -> Curve:
    points = [((4, 4), 200.0)] if quick else [((11, 10), 80.0), ((11, 10), 40.0), ((16, 15), 30.0)]
    makers = [partial(compute_plain, script, cells, step) for cells, step in points]
    settings = [(f"{nx} x {ny}", step) for (nx, ny), step in points]
    return Curve("plain", "plain NGSolve script", makers, settings)


@contextmanager
def rival_curves(quick: bool, dolfinx: str | None) -> Iterator[list[Curve]]:
    """Good scripts: all are built, at the same time, before any runs; their processes end with the context."""
    engines = {"good_ngsolve": ("good NGSolve script", sys.executable, "studies.rivals.good_ngsolve")}
    if dolfinx:
        engines["dolfinx"] = ("DOLFINx", dolfinx, "studies.rivals.dolfinx_block")
    cases: dict[tuple[str, str], list[tuple[int, float]]] = {
        ("euler", "uniform"): [(11, 1e-2), (22, 1e-3), (22, 3e-4)],
        ("esdirk4", "uniform"): [(11, 1e-2), (22, 1e-3), (44, 1e-3)],
        ("euler", "graded"): [(4, 3e-3), (6, 3e-4), (8, 3e-5)],
        ("esdirk4", "graded"): [(3, 1e-2), (4, 1e-2), (4, 1e-3), (6, 1e-3), (6, 1e-4), (8, 3e-4), (12, 1e-5)],
    }
    if quick:
        cases = {("euler", "uniform"): [(6, 1e-2)], ("esdirk4", "graded"): [(3, 1e-2), (4, 1e-2)]}
    workers: dict[tuple[str, str, int], Worker] = {}
    curves = []
    try:
        for engine, (label, python, module) in engines.items():
            for (scheme, mesh), points in cases.items():
                makers: list[Callable[[], ComputedBlock | None]] = []
                for cells, tolerance in points:
                    shape = (cells, cells, 6.0, 3) if mesh == "graded" else (cells, cells * 10 // 11, 1.0, 2)
                    options = [part for pair in zip(GRID, shape, strict=True) for part in pair]
                    key = (engine, mesh, cells)
                    if key not in workers:
                        workers[key] = Worker(python, module, options + ["--bytecode"] * quick)
                    makers.append(partial(compute_rival, workers[key], scheme, tolerance))
                settings = [(f"{cells} x {cells if mesh == 'graded' else cells * 10 // 11}", at) for cells, at in points]
                name = f"{engine}_{scheme}_{mesh}"
                curves.append(Curve(name, f"{label}, {LABELS[scheme]}, {mesh}", makers, settings))
        for worker in workers.values():
            worker.ready()
        yield curves
    finally:
        for worker in workers.values():
            worker.close()


GRID = ("--nx", "--ny", "--grade", "--order")
LABELS = {"euler": "backward Euler", "esdirk4": "ESDIRK4"}


def options(parser: argparse.ArgumentParser) -> None:
    """`--plain PATH`, `--references`; `--dolfinx PYTHON`, which `iteration` has as well."""
    parser.add_argument("--references", action="store_true", help="speed_error: make the reference anew first")
    parser.add_argument("--plain", type=existing, help="speed_error: the plain NGSolve script to compare with")
    add_dolfinx(parser)


def existing(path: str) -> Path:
    """The path of a file; refused if there is none."""
    if not Path(path).is_file():
        raise argparse.ArgumentTypeError(f"there is no file {path}")
    return Path(path)


@dataclass(frozen=True)
class Comparison:
    """All curves, what they are compared with, and the area error of the paper's penalty."""

    curves: list[Curve]
    kept: Kept
    penalty_error: float

    @property
    def reference(self) -> Reference:
        return self.kept.reference

    @property
    def plain(self) -> Curve | None:
        """The plain script's."""
        return next((curve for curve in self.curves if curve.name == "plain"), None)


def run(quick: bool = False, plain: Path | None = None, dolfinx: str | None = None, references: bool = False) -> Findings:
    """All curves, their points in turns, and what they say."""
    script, turns = SCRIPT if plain is None else plain, 1 if quick else 3
    there = usable(dolfinx)
    if references:
        make_references(dolfinx if there else None)
    with rival_curves(quick, dolfinx if there else None) as rivals:
        comparison = compute(quick, script if script.is_file() else None, rivals, turns)
    found = numbers(comparison)
    found["plain"] = "run" if comparison.plain else f"absent: no {script.name}; name it with --plain"
    found["dolfinx"] = there or ABSENT
    results = [course.result for curve in comparison.curves for course in curve.courses if course.result]
    found |= {"mesh": "see the CSV", "turns": turns, "threads": ngsglobals.numthreads, "machine": machine(), **cost(results)}
    header = ("curve", "mesh", "tolerance_or_step", "unknowns", "seconds", "seconds_min", "seconds_max", "setup_seconds",
              "area_error", "pressure_error", "steps", "newton_iterations", "factorisations", "solves")  # fmt: skip
    rows = [row for curve in comparison.curves for row in table(curve, comparison.reference)]
    return Findings(draw(comparison), header, rows, found)


def make_references(dolfinx: str | None) -> None:
    """Compute both and keep the first in its file."""
    if not dolfinx:
        raise InputError("speed_error --references needs DOLFINx; remedy: --dolfinx PYTHON")
    options = [part for pair in zip(GRID, (16, 16, 20.0, 5), strict=True) for part in pair]
    worker = Worker(dolfinx, "studies.rivals.dolfinx_block", options)
    try:
        first = compute_rival(worker, "esdirk4", 1e-7)
    finally:
        worker.close()
    assert first is not None
    second = compute_ours(Way(Potential(6), 10, 20.0, Adaptive(1e-6)), "second reference")
    how = f"{usable(dolfinx)}: order 5, 16 x 16 cells graded 20, ESDIRK4 with 1e-7"
    check = f"ngswell {__version__}: Potential(6), 10 x 10 cells graded 20, Adaptive(1e-6)"
    reference.write(first, second, f"{how}; second {check}")


def compute(quick: bool, script: Path | None, rivals: list[Curve], turns: int) -> Comparison:
    """The penalty's own error, and all curves in turns."""
    cells, steps = (4, Adaptive(1e-3)) if quick else (8, Adaptive(1e-5))
    exact, weak = (compute_ours(Way(Concentration(3), cells, 6.0, steps, penalty), "penalty") for penalty in (None, 40.0))
    curves = [*rivals, *our_curves(quick), paper_curve(quick)]
    if script:
        curves.insert(0, plain_curve(script, quick))
    for _ in range(turns):
        for curve in curves:
            curve.take_turn()
    return Comparison(curves, reference.read(), Reference(exact).area_error(weak))


def numbers(comparison: Comparison) -> dict[str, float | int | str]:
    """Seconds for each wanted error, and how they compare."""
    exact = comparison.reference
    found: dict[str, float | int | str] = {
        "reference_area_error": comparison.kept.area_error,
        "reference_pressure_error": comparison.kept.pressure_error,
        "penalty_40_area_error": comparison.penalty_error,
    }
    area: dict[str, dict[float, tuple[float, str]]] = {}
    pressure: dict[str, dict[float, tuple[float, str]]] = {}
    for curve in comparison.curves:
        if curve.rival:
            found[f"{curve.name}_failed"] = "; ".join(curve.failed) or "none"
        if not curve.courses:
            continue
        area[curve.name] = {at: seconds_at(at, curve.area_errors(exact), curve.seconds) for at in WANTED}
        for wanted, (seconds, how) in area[curve.name].items():
            found[f"{curve.name}_seconds_at_{_power(wanted)}"] = seconds
            found[f"{curve.name}_at_{_power(wanted)}"] = how
        found[f"{curve.name}_setup_seconds"] = max(course.setup for course in curve.courses)
        errors = curve.pressure_errors(exact)
        if errors is not None:
            pressure[curve.name] = {at: seconds_at(at, errors, curve.seconds) for at in WANTED}
    rivals = [curve.name for curve in comparison.curves if curve.rival]
    for wanted in WANTED:
        found |= ratio(wanted, area, rivals, "") | ratio(wanted, pressure, rivals, "pressure_")
        if "plain" in area and wanted > WANTED[-1]:
            best = found[f"best_at_{_power(wanted)}"]
            found[f"ratio_to_plain_at_{_power(wanted)}"] = area["plain"][wanted][0] / area[str(best)][wanted][0]
    found["best_rival"] = found[f"best_rival_at_{_power(WANTED[1])}"]
    return found


def ratio(
    wanted: float, at: dict[str, dict[float, tuple[float, str]]], rivals: Sequence[str], prefix: str
) -> dict[str, float | int | str]:
    """The fastest rival's seconds over those of the fastest of ours, and which and how they were found."""

    def order(name: str) -> tuple[bool, float]:
        seconds, how = at[name][wanted]
        return how == "extrapolated", seconds

    ours = min((name for name in at if name not in rivals and name != "paper"), key=order)
    theirs = min((name for name in at if name in rivals), key=order)
    (mine, how), (their, how_theirs) = at[ours][wanted], at[theirs][wanted]
    power = _power(wanted)
    return {
        f"{prefix}best_at_{power}": ours,
        f"{prefix}best_rival_at_{power}": theirs,
        f"{prefix}ratio_to_best_rival_at_{power}": their / mine,
        f"{prefix}ratio_at_{power}_is": "measured" if how == how_theirs == "measured" else f"rival {how_theirs}, ours {how}",
    }


def table(curve: Curve, reference: Reference) -> list[tuple[object, ...]]:
    """A row a point."""
    rows: list[tuple[object, ...]] = []
    areas = curve.area_errors(reference)
    pressures: Sequence[float | str] = curve.pressure_errors(reference) or [""] * len(areas)
    points = zip(curve.settings, curve.courses, curve.seconds, areas, pressures, strict=True)
    for (mesh, accuracy), course, seconds, area, pressure in points:
        done = course.result
        effort: tuple[object, ...] = tuple(course.counts.values()) if course.counts else ("",) * len(COUNTS)
        if done:
            effort = (len(done.steps), done.iterations, done.factorisations, done.solves)
        spread = (min(course.seconds), max(course.seconds))
        rows.append((curve.name, mesh, accuracy, course.unknowns, seconds, *spread, course.setup, area, pressure, *effort))
    return rows


def _power(wanted: float) -> str:
    return f"1e-{round(-np.log10(wanted))}"


STYLES: dict[str, dict[str, Any]] = {
    "plain": {"color": "k", "ls": "--", "marker": "P", "mfc": "w"},
    "paper": {"color": "k", "ls": ":", "marker": "x"},
    "good_ngsolve_euler_uniform": {"color": "tab:blue", "ls": ":", "marker": "s", "mfc": "w"},
    "good_ngsolve_esdirk4_uniform": {"color": "tab:blue", "ls": "-", "marker": "s", "mfc": "w"},
    "good_ngsolve_euler_graded": {"color": "tab:blue", "ls": ":", "marker": "o"},
    "good_ngsolve_esdirk4_graded": {"color": "tab:blue", "ls": "-", "marker": "o"},
    "dolfinx_euler_uniform": {"color": "tab:red", "ls": ":", "marker": "s", "mfc": "w"},
    "dolfinx_esdirk4_uniform": {"color": "tab:red", "ls": "-", "marker": "s", "mfc": "w"},
    "dolfinx_euler_graded": {"color": "tab:red", "ls": ":", "marker": "o"},
    "dolfinx_esdirk4_graded": {"color": "tab:red", "ls": "-", "marker": "o"},
    "potential_order_2_uniform": {"color": "0.6", "ls": "-", "marker": "s", "mfc": "w"},
    "potential_order_2_graded": {"color": "0.6", "ls": "-", "marker": "o"},
    "potential_order_3_graded": {"color": "k", "ls": "-", "marker": "^"},
    "potential_order_3_graded_compiled": {"color": "k", "ls": "-", "marker": "*"},
    "potential_order_4_graded": {"color": "k", "ls": "-.", "marker": "D", "mfc": "w"},
    "concentration_order_2_graded": {"color": "0.6", "ls": "--", "marker": "v"},
    "concentration_order_3_graded": {"color": "0.35", "ls": "--", "marker": "<", "mfc": "w"},
}
"""Marker, line and shade of each curve: ours readable in grey, good scripts in colour, one an engine."""


def draw(comparison: Comparison) -> Figure:
    """Errors of area and pressure over seconds of the time loop."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 5.4), sharex=True)
    for curve in comparison.curves:
        if not curve.courses:
            continue
        style = {"ms": 5, "lw": 1.1, **STYLES[curve.name]}
        left.loglog(curve.seconds, curve.area_errors(comparison.reference), label=curve.label, **style)
        pressures = curve.pressure_errors(comparison.reference)
        if pressures is not None:
            right.loglog(curve.seconds, pressures, **style)
    if comparison.plain:
        right.annotate("the plain script writes no pressures", (0.97, 0.12), xycoords="axes fraction", fontsize=8,
                       ha="right", va="bottom", color="0.35")  # fmt: skip
    apart = {"color": "0.4", "lw": 0.9, "ls": (0, (1, 3))}
    left.axhline(comparison.kept.area_error, label="what two references differ by", **apart)
    right.axhline(comparison.kept.pressure_error, **apart)
    left.set(xlabel="CPU time of the loop [s]", ylabel="largest error of the area / area at 7000 s [-]", title="area")
    right.set(xlabel="CPU time of the loop [s]", ylabel="error of the pressure, rms / rms [-]", title="pressure")
    letter_panels([left, right])
    figure.legend(loc="outside lower center", ncols=3, fontsize=7)
    return figure
