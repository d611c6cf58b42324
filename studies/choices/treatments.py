"""Every treatment of the bath's boundary, in both models: stability, error, cost.

Three scenes: the column of Fig. 4 and the strip of Fig. 8, both under the bath of Fig. 4 (0.15 to 0.125 mol/l in 10 s), and
the free-swelling block from rest at 7000 s to 7224 s. Every run of a scene takes the same time steps as its reference, the
potential model on a finer, graded mesh of order 3, so that what differs is the boundary and the mesh. Penalties and γ run
over fourteen decades, in units of K/h for p and of D₊/h for c, as far as they are accepted. The CSV has every run:

- `error`: largest difference to the reference over time, of the top's displacement over its last value (column, strip) or of
  the area over that at 7000 s (block);
- `condition`: largest L2 distance over time of p and c on the bath's boundary from Donnan equilibrium with the charge there,
  relative to p_D and c_D;
- `iterations`, `rejected`, `seconds`: Newton iterations, rejected steps, seconds of the time loop;
- `growth`: dominant eigenvalue of one step about the state at the start (strip); beyond ±1 the treatment is unstable;
- `outcome`: "passes", or the time at which a step failed for good, or the seventh time in the run [s].

Numbers (SCENE is column, strip or block; TREATMENT its name in the CSV; on the middle mesh unless stated):

- `SCENE_TREATMENT_plateau`: error at the largest ε or γ that passes (smaller ones may come closer, where the error of the
  treatment cancels that of the mesh); `..._from`, `..._to`: range (units of K/h) throughout which it is within 10 % of that;
  treatments without parameter have `SCENE_TREATMENT_error`;
- `SCENE_TREATMENT_condition`: smallest distance from the condition over the decades. On the block that is the kink of the
  blended baths within a cell;
- `SCENE_TREATMENT_iterations`: Newton iterations, median over the decades;
- `SCENE_TREATMENT_failures`: runs that fail, of all meshes and decades;
- `strip_TREATMENT_growth`: largest |growth| over the decades;
- `SCENE_reference_error`: distance between the reference and one on a mesh 1.5 times coarser;
- `SCENE_paper_over_K_h`, `SCENE_paper_over_D_h`: the paper's ε on its mesh, in units of K/h and of D₊/h.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter
from ngsolve import Mesh
from numpy.typing import NDArray
from tqdm import tqdm

from ngswell import (
    TABLE_1,
    TABLE_2,
    Area,
    Averaged,
    Concentration,
    Essential,
    Fixed,
    Frozen,
    InnerLayer,
    Lagged,
    LeastSquares,
    Multiplier,
    NgswellError,
    Nitsche,
    Penalty,
    Potential,
    Probe,
    Result,
    Scene,
    StepError,
    column,
    rectangle,
)
from ngswell.baths.nitsche import LEAST
from ngswell.baths.treatment import Treatment
from ngswell.mesh.points import integral_on_boundary
from ngswell.models.model import Model
from ngswell.observers.base import Observer
from ngswell.physics import donnan
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.steps import Step
from studies.output import Findings, cost, letter_panels
from studies.paper.oscillation import STEP
from studies.scenes import (
    COLUMN_HEIGHT,
    FALLING,
    HEIGHT,
    INITIAL,
    WIDTH,
    confined_column,
    free_swelling_block,
    strip,
    with_model,
    with_treatment,
)

DECADES = (1e-2, 1e-1, 1.0, 1e1, 1e2, 1e4, 1e6, 1e9, 1e12)
QUICK_DECADES = (1e-1, 1e4)
COARSENING = 1.5

Make = Callable[[Any], Treatment]


@dataclass(frozen=True)
class Choice:
    """A model with a treatment, or with a family of them over a penalty in units of K/h."""

    model: Model
    make: Make
    swept: bool = True
    least: float = 0.0  # values that the treatment takes

    def over(self, quick: bool) -> Sequence[float | None]:
        """The values to run."""
        decades = QUICK_DECADES if quick else DECADES
        return [value for value in decades if value >= self.least] if self.swept else (None,)


def fixed(model: Model, treatment: Treatment) -> Choice:
    return Choice(model, lambda _: treatment, swept=False)


CHOICES: dict[str, Choice] = {
    "penalty": Choice(Concentration(), lambda e: Penalty(relative=e)),
    "nitsche": Choice(Concentration(), lambda e: Nitsche(e), least=LEAST["symmetric"]),
    "nitsche skew": Choice(Concentration(), lambda e: Nitsche(e, "skew")),
    "nitsche without adjoint": Choice(Concentration(), lambda e: Nitsche(e, "none"), least=LEAST["none"]),
    "potential penalty": Choice(Potential(), lambda e: Penalty(relative=e)),
    "nitsche skew without penalty": fixed(Concentration(), Nitsche(0.0, "skew")),
    "multiplier": fixed(Concentration(), Multiplier()),
    "potential essential": fixed(Potential(), Essential()),
    "lagged": fixed(Concentration(), Lagged()),
    "lagged inner layer": fixed(Concentration(), Lagged(InnerLayer())),
    "lagged averaged": fixed(Concentration(), Lagged(Averaged())),
    "lagged least squares": fixed(Concentration(), Lagged(LeastSquares())),
    "frozen": fixed(Concentration(), Frozen()),
}


class Condition(Observer):
    """How far p and c on the baths' boundaries are from Donnan equilibrium with the charge there; L2, relative."""

    def __init__(self) -> None:
        super().__init__()
        self.values: list[float] = []

    def record(self, problem: Problem, time: float) -> None:
        outputs, m = problem.state.outputs(), problem.setup.material
        off = {"p": 0.0, "c": 0.0}
        size = {"p": 0.0, "c": 0.0}
        for boundary, bath in problem.baths.items():
            wanted = {
                "p": donnan.pressure(bath.salt, outputs["cfc"], m.RT, bath.P),
                "c": donnan.cations(bath.salt, outputs["cfc"]),
            }
            for name, output in (("p", "p"), ("c", "c_plus")):
                difference = outputs[output] - wanted[name]
                off[name] += integral_on_boundary(problem.mesh, difference * difference, boundary, 6)
                size[name] += integral_on_boundary(problem.mesh, wanted[name] * wanted[name], boundary, 6)
        self.values.append(float(max(np.sqrt(off[name] / size[name]) for name in off)))


class TooManyRejections(NgswellError):
    """A run that has rejected too many steps until `time` [s]."""

    def __init__(self, time: float, count: int) -> None:
        super().__init__(f"{count} steps are rejected until t = {time:.10g} s")
        self.time = time


class Patience(Observer):
    """Ends a run that has rejected more than six steps: it would creep on for long."""

    rejected = 0

    def observe(self, problem: Problem, step: Step) -> None:
        self.rejected += len(step.rejected)
        if self.rejected > 6:
            raise TooManyRejections(step.time, self.rejected)


@dataclass(frozen=True)
class ComparedScene:
    """A scene on meshes from coarse to fine, its steps, and what is compared."""

    name: str
    scene: Callable[[Mesh], Scene]
    meshes: tuple[Mesh, ...]
    reference: Callable[[float], Mesh]  # of a coarsening
    cells: tuple[str, ...]
    step: float  # s
    until: float  # s
    observer: Callable[[], Any]
    series: Callable[[Any], NDArray]
    begin: Callable[[Scene], Snapshot] | None = None

    def with_(self, mesh: Mesh, model: Model, treatment: Treatment) -> Scene:
        return with_model(self.scene(mesh), model, treatment)


@dataclass(frozen=True)
class Outcome:
    """One run: its series, the largest distance from the condition, its cost; `failed` is the time of the failure [s]."""

    time: NDArray
    series: NDArray
    condition: float
    result: Result | None
    failed: float | None


def at_rest(scene: Scene) -> Snapshot:
    """The block at 7000 s. A homogeneous state, the same for every treatment, without effluxes."""
    treatment = Essential() if isinstance(scene.model, Potential) else Penalty(relative=1e4)
    rest = with_treatment(scene, treatment).equilibrate(INITIAL)
    values = np.zeros(scene.problem.vector.size)
    values[: rest.values.size] = rest.values
    return Snapshot(rest.time, values)


def execute(case: ComparedScene, scene: Scene, watch_condition: bool = True) -> Outcome:
    """Run a scene to the case's end, or to where it fails."""
    watched, condition = case.observer(), Condition()
    observers = [watched, Patience(), *([condition] if watch_condition else [])]
    begin = case.begin(scene) if case.begin else None
    result, failed = None, None
    try:
        result = scene.run(case.until, Fixed(case.step), observers, resume=begin)
    except (StepError, TooManyRejections) as error:
        failed = error.time
    return Outcome(watched.time, case.series(watched), max(condition.values[1:], default=0.0), result, failed)


def top(probe: Probe) -> NDArray:
    values = probe.values["displacement"]
    return values if values.ndim == 1 else values[:, -1]


def compared_column(cells: tuple[int, ...], until: float) -> ComparedScene:
    """The column of Fig. 4."""
    return ComparedScene(
        "column", lambda mesh: confined_column(c=FALLING, mesh=mesh),
        tuple(column(COLUMN_HEIGHT, n) for n in cells), graded_column, tuple(f"{n}" for n in cells), 2.5, until,
        lambda: Probe((COLUMN_HEIGHT,), "displacement"), top,
    )  # fmt: skip


def compared_strip(cells: tuple[int, ...], until: float) -> ComparedScene:
    """The strip of Fig. 8 under the bath of Fig. 4."""
    return ComparedScene(
        "strip", lambda mesh: strip(c=FALLING, mesh=mesh),
        tuple(rectangle(0.02, COLUMN_HEIGHT, 1, n) for n in cells), graded_column, tuple(f"1 x {n}" for n in cells),
        2.5, until, lambda: Probe((0.0, COLUMN_HEIGHT), "displacement"), top,
    )  # fmt: skip


def compared_block(cells: tuple[int, ...], reference: int, step: float, until: float) -> ComparedScene:
    """The free-swelling block from rest; its reference has `reference` cells a side."""

    def graded(coarsening: float) -> Mesh:
        n = round(reference / coarsening)
        return rectangle(WIDTH, HEIGHT, n, n, grade={"top": 6, "left": 6, "bottom": 6})

    return ComparedScene(
        "block", lambda mesh: free_swelling_block(1, 1, mesh=mesh),
        tuple(rectangle(WIDTH, HEIGHT, n, n) for n in cells), graded, tuple(f"{n} x {n}" for n in cells), step, until,
        Area, lambda area: area.values, at_rest,
    )  # fmt: skip


def graded_column(coarsening: float) -> Mesh:
    return column(COLUMN_HEIGHT, round(60 / coarsening), grade={"top": 10})


def compared_scenes(quick: bool) -> list[ComparedScene]:
    """The three scenes on three meshes each."""
    if quick:
        lines, end, block = (6, 8, 12), 25.0, compared_block((3, 4, 6), 6, 16.0, 7100.0)
    else:
        lines, end, block = (15, 30, 60), 60.0, compared_block((6, 11, 22), 20, 8.0, 7224.0)
    return [compared_column(lines, end), compared_strip(lines, end), block]


def reference(case: ComparedScene, coarsening: float = 1.0) -> Outcome:
    """The potential model of order 3 on a graded mesh. The strip's is the column: nothing varies across it."""
    if case.name == "strip":
        alike = compared_column((), case.until)
        case = replace(case, scene=alike.scene, observer=alike.observer)
    model = Potential(order=3)
    return execute(case, case.with_(case.reference(coarsening), model, Essential()), watch_condition=False)


def distance(outcome: Outcome, exact: Outcome, case: ComparedScene) -> float:
    """Largest difference to the reference over its times, in units of the last displacement or the first area."""
    size = exact.series[0] if case.name == "block" else exact.series[-1]
    difference = np.interp(exact.time, outcome.time, outcome.series) - exact.series
    return float(np.abs(difference).max() / abs(size))


def growth(choice: Choice, value: float | None) -> float:
    """|growth| of one step of the strip of Fig. 8 at rest."""
    return abs(strip(choice.make(value), model=choice.model).growth_factor(STEP).factor)


@dataclass(frozen=True)
class Row:
    """One run in the table; `error` and `condition` are nan where it failed."""

    case: str
    mesh: str
    treatment: str
    value: float | None
    error: float
    condition: float
    iterations: int
    rejected: int
    seconds: float
    failed: float | None


def row(case: ComparedScene, cells: str, name: str, value: float | None, outcome: Outcome, exact: Outcome) -> Row:
    done = outcome.result
    if done is None:
        return Row(case.name, cells, name, value, np.nan, np.nan, 0, 0, np.nan, outcome.failed)
    error, seconds = distance(outcome, exact, case), round(done.seconds, 4)
    return Row(case.name, cells, name, value, error, outcome.condition, done.iterations, done.rejections, seconds, None)


@dataclass(frozen=True)
class Survey:
    """All runs of all scenes; the references' own errors; |growth| of each treatment and value on the strip."""

    scenes: list[ComparedScene]
    rows: list[Row]
    results: list[Result]
    reference_errors: dict[str, float]
    growths: dict[tuple[str, float | None], float]


def run(quick: bool = False) -> Findings:
    """All of them."""
    survey = compute(quick)
    header = ("scene", "mesh", "treatment", "value", "error", "condition", "iterations", "rejected", "seconds", "growth",
              "outcome")  # fmt: skip
    table = [
        (
            r.case, r.mesh, r.treatment, blank(r.value), blank(r.error), blank(r.condition), r.iterations, r.rejected,
            blank(r.seconds), survey.growths[r.treatment, r.value] if r.case == "strip" else "",
            "passes" if r.failed is None else f"fails at {r.failed:.6g} s",
        )
        for r in survey.rows
    ]  # fmt: skip
    return Findings(draw(survey.scenes, survey.rows), header, table, numbers(survey))


def compute(quick: bool) -> Survey:
    """Every scene on every mesh with every treatment and value."""
    scenes = compared_scenes(quick)
    variants = [(name, choice, value) for name, choice in CHOICES.items() for value in choice.over(quick)]
    survey = Survey(scenes, [], [], {}, {})
    for case in scenes:
        exact = reference(case)
        survey.reference_errors[case.name] = distance(reference(case, COARSENING), exact, case)
        for cells, mesh in zip(case.cells, case.meshes, strict=True):
            runs = tqdm(variants, desc=f"{case.name} {cells}", leave=False, disable=not sys.stderr.isatty())
            outcomes = [(n, v, execute(case, case.with_(mesh, choice.model, choice.make(v)))) for n, choice, v in runs]
            survey.results.extend(outcome.result for _, _, outcome in outcomes if outcome.result)
            survey.rows.extend(row(case, cells, name, value, outcome, exact) for name, value, outcome in outcomes)
            failures = sum(outcome.failed is not None for _, _, outcome in outcomes)
            print(f"treatments {case.name} {cells}: {len(outcomes)} runs, {failures} fail", file=sys.stderr, flush=True)
    survey.growths.update({(name, value): growth(choice, value) for name, choice, value in variants})
    return survey


def numbers(survey: Survey) -> dict[str, float | int | str]:
    """What the runs say, a treatment and a scene at a time."""
    found: dict[str, float | int | str] = {f"{n}_reference_error": error for n, error in survey.reference_errors.items()}
    for case in survey.scenes:
        for name in CHOICES:
            found |= summary(case, name, [r for r in survey.rows if (r.case, r.treatment) == (case.name, name)])
    for name in CHOICES:
        found[f"strip_{key(name)}_growth"] = max(size for (of, _), size in survey.growths.items() if of == name)
    found |= paper_in_natural_units()
    mesh = "; ".join(f"{case.name} {', '.join(case.cells)}" for case in survey.scenes)
    return found | {"mesh": mesh, **cost(survey.results)}


def blank(value: float | None) -> float | str:
    return "" if value is None or np.isnan(value) else value


def key(name: str) -> str:
    return name.replace(" ", "_")


def summary(case: ComparedScene, name: str, rows: list[Row]) -> dict[str, float | int]:
    """What the rows of one treatment in one scene say."""
    prefix = f"{case.name}_{key(name)}"
    found: dict[str, float | int] = {f"{prefix}_failures": sum(r.failed is not None for r in rows)}
    middle = [r for r in rows if r.mesh == case.cells[1] and r.failed is None]
    if not middle:
        return found
    found[f"{prefix}_condition"] = min(r.condition for r in middle)
    found[f"{prefix}_iterations"] = int(np.median([r.iterations for r in middle]))
    if not CHOICES[name].swept:
        return found | {f"{prefix}_error": middle[0].error}
    swept = sorted((r.value, r.error) for r in middle if r.value is not None)
    plateau = swept[-1][1]
    beside = [value for value, error in swept if not plateau / 1.1 <= error <= 1.1 * plateau]
    first = min(value for value, _ in swept if value > max(beside, default=0.0))
    return found | {f"{prefix}_plateau": plateau, f"{prefix}_from": first, f"{prefix}_to": swept[-1][0]}


def paper_in_natural_units() -> dict[str, float]:
    """ε = 1 and 40 on the paper's meshes: h = 1/60 mm and 0.05 mm."""
    of = {"strip": (1.0, 0.5 / 30, TABLE_1), "block": (40.0, HEIGHT / 20, TABLE_2)}
    numbers = {}
    for name, (epsilon, h, material) in of.items():
        numbers[f"{name}_paper_over_K_h"] = epsilon * h / material.number("K")
        numbers[f"{name}_paper_over_D_h"] = epsilon * h / material.number("D_plus")
    return numbers


# Line and marker of each family, and open marker of each treatment without parameter.
STYLES = {
    "penalty": ("k", "-", "o"), "nitsche": ("k", "--", "s"), "nitsche skew": ("0.5", "--", "^"),
    "nitsche without adjoint": ("0.5", ":", "v"), "potential penalty": ("0.5", "-", "D"),
}  # fmt: skip
MARKS = {
    "nitsche skew without penalty": "^", "multiplier": "s", "potential essential": "D",
    "lagged": "x", "lagged inner layer": "+", "lagged averaged": "1", "lagged least squares": "2", "frozen": "*",
}  # fmt: skip


ON_PLATEAU = 1e4
BESIDE = 1e14
"""Where on the axis of ε the treatments without parameter stand."""


def draw(scenes: Sequence[ComparedScene], rows: Sequence[Row]) -> Figure:
    """Error over the penalty on the middle mesh, and error over seconds on all meshes with ε, γ on the plateau."""
    figure, grid = plt.subplots(2, 3, figsize=(9.8, 7.8))
    for column_, case in enumerate(scenes):
        mine = [r for r in rows if r.case == case.name]
        over_value, over_seconds = grid[0, column_], grid[1, column_]
        draw_sweeps(over_value, [r for r in mine if r.mesh == case.cells[1]])
        over_value.set(title=f"{case.name}, {case.cells[1]} cells", xlabel="ε or γ [K/h and D₊/h]")
        draw_costs(over_seconds, mine)
        over_seconds.set(xlabel="time loop [s], single runs", title=f"{case.name}, ε, γ = 1e4, three meshes")
    for axes in grid.flat:
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_minor_formatter(NullFormatter())
    for axes in grid[1]:
        low, high = axes.get_xlim()
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 5, 7) if high < 5 * low else (1, 2, 5)))
        axes.xaxis.set_major_formatter(ScalarFormatter())
    for axes in grid[:, 0]:
        axes.set_ylabel("largest relative error [-]")
    for axes in grid[:, 2]:  # within a decade or two
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter(ScalarFormatter())
    letter_panels(grid.flat, pad=8)  # above the marks on the upper edge
    handles = [
        Line2D([], [], color=colour, ls=line, marker=marker, ms=4, lw=1, label=name)
        for name, (colour, line, marker) in STYLES.items()
    ]
    handles += [Line2D([], [], color="k", mfc="w", ls="", marker=marker, ms=5, label=name) for name, marker in MARKS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=7.5)
    return figure


def draw_sweeps(axes: Axes, rows: Sequence[Row]) -> None:
    """Families over their parameter; on the right those without; open marks at the top where a run fails."""
    for name, (colour, line, marker) in STYLES.items():
        mine = [r for r in rows if r.treatment == name and r.value is not None]
        good = [(r.value, r.error) for r in mine if r.failed is None]
        if good:
            axes.loglog(*zip(*good, strict=True), color=colour, ls=line, marker=marker, ms=3.5, lw=1)
        draw_failures(axes, [r.value for r in mine if r.value and r.failed is not None], colour, marker)
    for r in rows:
        if r.treatment in MARKS:
            place = BESIDE * 4.0 ** list(MARKS).index(r.treatment)
            if r.failed is None:
                axes.loglog(place, r.error, "k", mfc="w", marker=MARKS[r.treatment], ls="", ms=5)
            else:
                draw_failures(axes, [place], "k", MARKS[r.treatment])
    axes.axvline(BESIDE / 10, color="0.7", lw=0.8)
    axes.set_xlim(right=BESIDE * 4.0 ** len(MARKS))
    axes.set_xticks([value for value in DECADES if value in (1e-2, 1e2, 1e6, 1e12)])


def draw_failures(axes: Axes, values: Sequence[float], colour: str, marker: str) -> None:
    if not values:
        return
    (marks,) = axes.plot(values, [1.0] * len(values), marker=marker, ls="", ms=5, mfc="none", mec=colour,
              transform=axes.get_xaxis_transform(), clip_on=False)  # fmt: skip
    marks.set_in_layout(False)


def draw_costs(axes: Axes, rows: Sequence[Row]) -> None:
    """Each treatment on each mesh, on its plateau. Single runs on a shared machine: points, not lines."""
    for name in CHOICES:
        mine = [r for r in rows if r.treatment == name and r.value in (None, ON_PLATEAU) and r.failed is None]
        colour, _, marker = STYLES.get(name, ("k", "", MARKS.get(name, "")))
        fill = colour if name in STYLES else "w"
        if mine:
            seconds, errors = [r.seconds for r in mine], [r.error for r in mine]
            axes.loglog(seconds, errors, ls="", color=colour, mfc=fill, marker=marker, ms=4.5)
