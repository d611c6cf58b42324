"""Error against time: the free-swelling block by a plain NGSolve script, by the paper's way, and by our choices.

Errors are against a reference, whose own error is estimated by a second one with another order, mesh and tolerance. Area:
largest error over all steps from 0 to 11000 s, relative to the area at 7000 s. Pressure: root mean square over the block at
the worst of the pictured times, relative to that of the pressure. Seconds are those of the time loop, medians of runs that
take turns. For each curve NAME of the figure:

- `NAME_seconds_at_1e-2`, `..._1e-3`, `..._1e-4` [s] for that error of the area, on the line through the points that no
  other point of the curve beats in both error and time; `NAME_at_1e-2` and so on: "measured" (between points),
  "extrapolated" (beyond the most accurate, with the slope of all), "at most" (the cheapest point is already more accurate);
- `NAME_setup_seconds` [s]: mesh, spaces, forms and their compilation, observers, for the dearest point of the curve;
- `ratio_to_plain_at_1e-2`, `..._1e-3`: seconds of the plain script over those of the best of our curves, `best_at_...`;
- `reference_area_error`, `reference_pressure_error`: what the two references differ by;
- `threads`: NGS_NUM_THREADS, for the plain script as well;
- `penalty_40_area_error`: what the paper's penalty itself changes, on one mesh with one tolerance.

The plain script is no part of the project: `--plain PATH` names it, or it lies in ../shared/peers beside the checkout; else
`plain` says that it is absent, and the ratios are left out. `plain_failed`: meshes and steps with which it gave up.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from ngsolve import ngsglobals
from numpy.typing import NDArray

from ngswell import (
    BACKWARD_EULER,
    Adaptive,
    Area,
    Concentration,
    Penalty,
    Potential,
    Progress,
    Result,
    Scene,
    Snapshots,
    rectangle,
)
from ngswell.models.model import Model
from ngswell.stepping.attempts import polynomial_at
from studies.output import Findings, cost, letter_panels
from studies.paper.free_swelling import PICTURES as ALL_PICTURES
from studies.scenes import BLENDED, END, HEIGHT, INITIAL, WIDTH, free_swelling_block, with_model

PICTURES = ALL_PICTURES[1:]
SCRIPT = Path(__file__).resolve().parents[3] / "shared" / "peers" / "plain_ngsolve.py"
BENDS = {"x": BLENDED, "y": BLENDED}
"""Where the blended baths bend [mm]."""

WANTED = (1e-2, 1e-3, 1e-4)
SAMPLES = np.stack(
    np.meshgrid(WIDTH * (np.arange(24) + 0.497) / 24, HEIGHT * (np.arange(24) + 0.497) / 24), axis=-1
).reshape(-1, 2)
"""Where pressures are compared [mm]; off the lines of all meshes used."""


@dataclass(frozen=True)
class Way:
    """One way to compute the scene."""

    model: Model
    cells: int
    grade: float  # largest over smallest cell, toward the baths; beyond 1, mesh lines also lie where the baths bend
    steps: Adaptive
    penalty: float | None = None  # the paper's ε; None: the model's default

    def scene(self) -> Scene:
        treatment = None if self.penalty is None else Penalty(self.penalty)
        grade = dict.fromkeys(("top", "left", "bottom"), self.grade)
        mesh = rectangle(WIDTH, HEIGHT, self.cells, self.cells, grade=grade, lines=BENDS if self.grade > 1 else None)
        return with_model(free_swelling_block(1, 1, mesh=mesh), self.model, treatment)


@dataclass
class ComputedBlock:
    """A run's area over time, its pressures at the pictured times, and what it cost."""

    time: NDArray
    area: NDArray
    pressures: NDArray | None
    unknowns: int
    seconds: list[float]
    setup: float = 0.0
    result: Result | None = None


def compute_ours(run: Way, label: str) -> ComputedBlock:
    """One of our own runs; what is not its time loop is setup."""
    clock = perf_counter()
    scene = run.scene()
    area, pictures = Area(), Snapshots(PICTURES)
    result = scene.run(END, run.steps, [area, pictures, Progress(f"speed_error {label}")])
    setup = perf_counter() - clock - result.seconds
    samples = scene.mesh(*SAMPLES.T)
    pressures = np.array([scene.state(picture).output("p")(samples).ravel() for picture in pictures.states])
    return ComputedBlock(area.time, area.values, pressures, result.end.values.size, [result.seconds], setup, result)


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


@dataclass
class Reference:
    """What is taken as exact: area over time between the kinks of the baths, and pressures."""

    course: ComputedBlock
    kinks: Sequence[float] = (0.0, 4000.0, 7000.0, 7080.0, 7220.0, 8000.0, 10000.0, END)

    def area(self, time: NDArray) -> NDArray:
        """Cubic through the four nearest steps, none beyond a kink."""
        values = np.empty_like(time)
        for number, at in enumerate(time):
            after = next(kink for kink in self.kinks[1:] if at <= kink + 1e-6)
            before = max(kink for kink in self.kinks if kink < after)
            inside = np.flatnonzero((self.course.time >= before - 1e-6) & (self.course.time <= after + 1e-6))
            near = inside[np.argsort(np.abs(self.course.time[inside] - at))[:4]]
            values[number] = polynomial_at([(self.course.time[n], self.course.area[n]) for n in near], at)
        return values

    def area_error(self, course: ComputedBlock) -> float:
        initial = self.area(np.array([INITIAL]))[0]
        return float(np.abs(course.area - self.area(course.time)).max() / initial)

    def pressure_error(self, course: ComputedBlock) -> float:
        assert course.pressures is not None
        assert self.course.pressures is not None
        size = np.sqrt((self.course.pressures**2).mean(axis=1))
        return float((np.sqrt(((course.pressures - self.course.pressures) ** 2).mean(axis=1)) / size).max())


@dataclass
class Curve:
    """Ways to compute the scene that differ in mesh and accuracy."""

    name: str
    label: str
    makers: Sequence[Callable[[], ComputedBlock | None]]
    settings: list[tuple[str, float]]
    courses: list[ComputedBlock] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    def take_turn(self) -> None:
        """Run every point once; the second time only the seconds are new. Points that fail are dropped, and said."""
        again = [make() for make in self.makers]
        if not self.courses:
            self.failed = [f"{mesh}, {at:g} s" for (mesh, at), run in zip(self.settings, again, strict=True) if not run]
            kept = [number for number, course in enumerate(again) if course]
            self.makers, self.settings = [self.makers[n] for n in kept], [self.settings[n] for n in kept]
            self.courses = [course for course in again if course]
            return
        for course, other in zip(self.courses, again, strict=True):
            if other:
                course.seconds += other.seconds

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

    def curve(name: str, model: Model, grade: float, points: Sequence[tuple[int, float]]) -> Curve:
        runs = [Way(model, cells, grade, Adaptive(tolerance)) for cells, tolerance in points]
        return through(name.lower().replace(" ", "_"), name, runs)

    second = [(4, 1e-1), (6, 3e-2)] if quick else [(6, 3e-2), (8, 1e-2), (12, 3e-3), (16, 1e-3), (24, 3e-4)]
    third = [(3, 1e-1), (5, 3e-2)] if quick else [(3, 1e-1), (4, 1e-2), (6, 1e-3), (8, 3e-4), (8, 1e-4), (12, 3e-5)]
    fourth = [(2, 1e-1), (4, 3e-2)] if quick else [(3, 1e-2), (4, 1e-3), (6, 3e-4), (6, 1e-4), (8, 3e-5)]
    uniform = [(4, 1e-1), (6, 3e-2)] if quick else [(6, 3e-2), (11, 1e-2), (22, 1e-3)]
    return [
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


def options(parser: argparse.ArgumentParser) -> None:
    """`--plain PATH`."""
    parser.add_argument("--plain", type=existing, help="speed_error: the plain NGSolve script to compare with")


def existing(path: str) -> Path:
    """The path of a file; refused if there is none."""
    if not Path(path).is_file():
        raise argparse.ArgumentTypeError(f"there is no file {path}")
    return Path(path)


@dataclass(frozen=True)
class Comparison:
    """All curves, the reference, a second one, and the area error of the paper's penalty."""

    curves: list[Curve]
    reference: Reference
    second: ComputedBlock
    penalty_error: float

    @property
    def plain(self) -> Curve | None:
        """The plain script's."""
        return next((curve for curve in self.curves if curve.name == "plain"), None)


def run(quick: bool = False, plain: Path | None = None) -> Findings:
    """All curves, their points three times in turns, and what they say."""
    script, turns = SCRIPT if plain is None else plain, 1 if quick else 3
    comparison = compute(quick, script if script.is_file() else None, turns)
    found = numbers(comparison)
    found["plain"] = "run" if comparison.plain else f"absent: no {script.name}; name it with --plain"
    results = [course.result for curve in comparison.curves for course in curve.courses if course.result]
    found |= {"mesh": "see the CSV", "turns": turns, "threads": ngsglobals.numthreads, **cost(results)}
    header = ("curve", "mesh", "tolerance_or_step", "unknowns", "seconds", "seconds_min", "seconds_max", "setup_seconds",
              "area_error", "pressure_error", "steps", "newton_iterations", "factorisations", "solves")  # fmt: skip
    rows = [row for curve in comparison.curves for row in table(curve, comparison.reference)]
    return Findings(draw(comparison), header, rows, found)


def compute(quick: bool, script: Path | None, turns: int) -> Comparison:
    """The references, the penalty's own error, and all curves in turns."""
    best = Way(Potential(3), 8, 6.0, Adaptive(1e-4)) if quick else Way(Potential(4), 10, 8.0, Adaptive(1e-5))
    other = Way(Potential(3), 6, 6.0, Adaptive(3e-4)) if quick else Way(Potential(3), 14, 10.0, Adaptive(2e-5))
    reference, second = Reference(compute_ours(best, "reference")), compute_ours(other, "second reference")
    cells, steps = (4, Adaptive(1e-3)) if quick else (8, Adaptive(1e-5))
    exact, weak = (compute_ours(Way(Concentration(3), cells, 6.0, steps, penalty), "penalty") for penalty in (None, 40.0))
    curves = [*our_curves(quick), paper_curve(quick)]
    if script:
        curves.insert(0, plain_curve(script, quick))
    for _ in range(turns):
        for curve in curves:
            curve.take_turn()
    return Comparison(curves, reference, second, Reference(exact).area_error(weak))


def numbers(comparison: Comparison) -> dict[str, float | int | str]:
    """Seconds for each wanted error, and how much less than the plain script that is."""
    reference = comparison.reference
    found: dict[str, float | int | str] = {
        "reference_area_error": reference.area_error(comparison.second),
        "reference_pressure_error": reference.pressure_error(comparison.second),
        "penalty_40_area_error": comparison.penalty_error,
    }
    if comparison.plain:
        found["plain_failed"] = "; ".join(comparison.plain.failed) or "none"
    at: dict[str, dict[float, float]] = {}
    for curve in comparison.curves:
        at[curve.name] = {}
        for wanted in WANTED:
            at[curve.name][wanted], how = seconds_at(wanted, curve.area_errors(reference), curve.seconds)
            found[f"{curve.name}_seconds_at_{_power(wanted)}"] = at[curve.name][wanted]
            found[f"{curve.name}_at_{_power(wanted)}"] = how
        found[f"{curve.name}_setup_seconds"] = max(course.setup for course in curve.courses)
    ours = [curve.name for curve in comparison.curves if curve.name not in ("plain", "paper")]
    for wanted in WANTED[:2] if "plain" in at else ():
        fastest = min(ours, key=lambda name: at[name][wanted])
        found[f"best_at_{_power(wanted)}"] = fastest
        found[f"ratio_to_plain_at_{_power(wanted)}"] = at["plain"][wanted] / at[fastest][wanted]
    return found


def table(curve: Curve, reference: Reference) -> list[tuple[object, ...]]:
    """A row a point."""
    rows: list[tuple[object, ...]] = []
    areas = curve.area_errors(reference)
    pressures: Sequence[float | str] = curve.pressure_errors(reference) or [""] * len(areas)
    points = zip(curve.settings, curve.courses, curve.seconds, areas, pressures, strict=True)
    for (mesh, accuracy), course, seconds, area, pressure in points:
        done = course.result
        effort = (len(done.steps), done.iterations, done.factorisations, done.solves) if done else ("", "", "", "")
        spread = (min(course.seconds), max(course.seconds))
        rows.append((curve.name, mesh, accuracy, course.unknowns, seconds, *spread, course.setup, area, pressure, *effort))
    return rows


def _power(wanted: float) -> str:
    return f"1e-{round(-np.log10(wanted))}"


STYLES: dict[str, dict[str, Any]] = {
    "plain": {"color": "k", "ls": "--", "marker": "P", "mfc": "w"},
    "paper": {"color": "k", "ls": ":", "marker": "x"},
    "potential_order_2_uniform": {"color": "0.6", "ls": "-", "marker": "s", "mfc": "w"},
    "potential_order_2_graded": {"color": "0.6", "ls": "-", "marker": "o"},
    "potential_order_3_graded": {"color": "k", "ls": "-", "marker": "^"},
    "potential_order_4_graded": {"color": "k", "ls": "-.", "marker": "D", "mfc": "w"},
    "concentration_order_2_graded": {"color": "0.6", "ls": "--", "marker": "v"},
    "concentration_order_3_graded": {"color": "0.35", "ls": "--", "marker": "<", "mfc": "w"},
}
"""Marker, line and shade of each curve: readable in grey."""


def draw(comparison: Comparison) -> Figure:
    """Errors of area and pressure over seconds of the time loop."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4.6), sharex=True)
    for curve in comparison.curves:
        style = {"ms": 5, "lw": 1.1, **STYLES[curve.name]}
        left.loglog(curve.seconds, curve.area_errors(comparison.reference), label=curve.label, **style)
        pressures = curve.pressure_errors(comparison.reference)
        if pressures is not None:
            right.loglog(curve.seconds, pressures, **style)
    if comparison.plain:
        right.annotate("the plain script writes no pressures", (0.97, 0.95), xycoords="axes fraction", fontsize=8,
                       ha="right", va="top", color="0.35")  # fmt: skip
    apart = {"color": "0.4", "lw": 0.9, "ls": (0, (1, 3))}
    left.axhline(comparison.reference.area_error(comparison.second), label="what two references differ by", **apart)
    right.axhline(comparison.reference.pressure_error(comparison.second), **apart)
    left.set(xlabel="time loop [s]", ylabel="largest error of the area / area at 7000 s [-]", title="area")
    right.set(xlabel="time loop [s]", ylabel="error of the pressure, rms / rms [-]", title="pressure")
    letter_panels([left, right])
    figure.legend(loc="outside lower center", ncols=3, fontsize=8)
    return figure
