"""What a tolerance means: errors in time reached by runs that ask for 1e-2 to 1e-5.

The column of Fig. 4, and the free-swelling block from rest at 7000 s to 11000 s on 8 × 8 cells, both models with their
default baths. Compared with the same mesh at a tolerance of 1e-7, which lands on all steps of the others. For each SCENE
(`column_` or `block_` and the model), TOLERANCE and QUANTITY (`displacement` of the column's top and of the block's top
corner; `area` of the block): `SCENE_TOLERANCE_QUANTITY_error`, the largest over all steps, relative to the largest
displacement or the initial area; `SCENE_TOLERANCE_steps`; `column_..._seconds` [s] of the time loop. The same for backward
Euler (`..._euler_...`), for comparison, and `largest_ratio`, `smallest_ratio`: errors reached over asked, of the scene's
larger error at each tolerance; `smallest_ratio_from_1e-3` without the tolerance of 1e-2.

Then random scenes (`random_runs`, `random_scenes` of them): `worst_error_over_tolerance_TOLERANCE` and
`median_error_over_tolerance_TOLERANCE`: the largest error of the displacement in a run, relative to its largest change,
over the tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ngswell import (
    BACKWARD_EULER,
    ESDIRK4,
    Adaptive,
    Area,
    Concentration,
    DampedNewton,
    Potential,
    Probe,
    Progress,
    Result,
    Scene,
)
from ngswell.models.model import Model
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.schemes import Scheme
from studies.choices.random_runs import errors, random_run
from studies.output import Findings, cost, letter_panels
from studies.scenes import COLUMN_HEIGHT, END, FALLING, HEIGHT, INITIAL, confined_column, free_swelling_block, with_model

MODELS = (Concentration(), Potential())
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
REFERENCE = 1e-7
RANDOM, FEW = range(30), (3, 7, 17)
"""Numbers of the random scenes, and of those of the quick size: a column, a block and a disc."""
EXACT = DampedNewton(tolerance=1e-11, slowest=0.3)


@dataclass(frozen=True)
class SwellingBody:
    """A scene, where it starts and ends [s], and the corner that is watched there."""

    name: str
    scene: Scene
    begin: Snapshot | None
    end: float
    corner: tuple[float, ...]

    def watch(
        self, steps: Adaptive, times: list[float] | None, newton: DampedNewton | None = None
    ) -> tuple[NDArray, NDArray, Result]:
        """Times, and displacements and areas there (a row a time)."""
        area, corner = Area(when=times), Probe(self.corner, "displacement", when=times)
        label = f"tolerance {self.name} {steps.tolerance:g}"
        result = self.scene.run(self.end, steps, [area, corner, Progress(label)], newton=newton, resume=self.begin)
        moved = corner.values["displacement"].reshape(len(area.time), -1)
        return area.time, np.column_stack([moved, area.values]), result


@dataclass(frozen=True)
class ReachedError:
    """Largest errors in time of one run, by quantity, and what it cost."""

    body: str
    scheme: Scheme
    tolerance: float
    errors: dict[str, float]
    result: Result

    @property
    def key(self) -> str:
        short = "" if self.scheme is ESDIRK4 else "euler_"
        return f"{self.body}_{short}{self.tolerance:.0e}".replace("e-0", "e-")


def column(model: Model) -> SwellingBody:
    """The column of Fig. 4."""
    scene = with_model(confined_column(c=FALLING), model)
    return SwellingBody(f"column_{type(model).__name__.lower()}", scene, None, 1500.0, (COLUMN_HEIGHT,))


def block(model: Model, cells: int) -> SwellingBody:
    """The free-swelling block from rest."""
    scene = with_model(free_swelling_block(cells, cells), model)
    name = f"block_{type(model).__name__.lower()}"
    return SwellingBody(name, scene, scene.equilibrate(INITIAL), END, (0.0, HEIGHT))


def run(quick: bool = False) -> Findings:
    """All scenes, tolerances and both schemes."""
    cells = 4 if quick else 8
    bodies = [column(model) for model in MODELS] + [block(model, cells) for model in MODELS]
    reached = [error for body in bodies for error in compute(body, TOLERANCES[:1] if quick else TOLERANCES[:3])]
    random = [errors(random_run(number), TOLERANCES) for number in (FEW if quick else RANDOM)]
    found = (
        numbers(reached)
        | of_random(random)
        | {"mesh": f"60 segments; {cells} x {cells} quadrilaterals"}
        | cost([r.result for r in reached])
    )
    header = ("scene", "scheme", "tolerance", "displacement_error", "area_error", "steps", "seconds")
    rows = [
        (r.body, r.scheme.name, r.tolerance, r.errors["displacement"], r.errors.get("area", ""),
         len(r.result.steps), r.result.seconds)
        for r in reached
    ]  # fmt: skip
    return Findings(draw(reached, random), header, rows, found)


def compute(body: SwellingBody, of_euler: tuple[float, ...]) -> list[ReachedError]:
    """Both schemes at their tolerances, against a far smaller one that lands on all their steps."""
    runs = [
        (scheme, tolerance, body.watch(Adaptive(tolerance, scheme=scheme), None))
        for scheme, tolerances in ((ESDIRK4, TOLERANCES), (BACKWARD_EULER, of_euler))
        for tolerance in tolerances
    ]
    times = sorted({float(time) for _, _, (when, _, _) in runs for time in when})
    exact_times, exact, _ = body.watch(Adaptive(REFERENCE), times, EXACT)
    size = [np.abs(exact[:, :-1]).max(), exact[0, -1]]
    reached = []
    for scheme, tolerance, (when, values, result) in runs:
        defect = np.abs(values - exact[np.searchsorted(exact_times, when)])
        errors = {"displacement": float(defect[:, :-1].max() / size[0]), "area": float(defect[:, -1].max() / size[1])}
        if body.name.startswith("column"):
            del errors["area"]  # its length
        reached.append(ReachedError(body.name, scheme, tolerance, errors, result))
    return reached


def numbers(reached: list[ReachedError]) -> dict[str, float | int | str]:
    """Errors and steps of every run, and errors reached over asked."""
    found: dict[str, float | int | str] = {}
    for run in reached:
        found |= {f"{run.key}_{quantity}_error": error for quantity, error in run.errors.items()}
        found[f"{run.key}_steps"] = len(run.result.steps)
        if run.body.startswith("column"):
            found[f"{run.key}_seconds"] = run.result.seconds
    ratios = [(run.tolerance, max(run.errors.values()) / run.tolerance) for run in reached if run.scheme is ESDIRK4]
    found |= {"largest_ratio": max(ratio for _, ratio in ratios), "smallest_ratio": min(ratio for _, ratio in ratios)}
    found["smallest_ratio_from_1e-3"] = min(ratio for tolerance, ratio in ratios if tolerance < TOLERANCES[0])
    return found


def of_random(random: list[dict[float, float]]) -> dict[str, float | int]:
    """Largest and median error over each tolerance."""
    found: dict[str, float | int] = {"random_scenes": len(random)}
    for tolerance in TOLERANCES:
        ratios, short = [run[tolerance] for run in random], f"{tolerance:.0e}".replace("e-0", "e-")
        found[f"worst_error_over_tolerance_{short}"] = max(ratios)
        found[f"median_error_over_tolerance_{short}"] = float(np.median(ratios))
    return found


MARKERS = {"column_concentration": "v", "column_potential": "^", "block_concentration": "s", "block_potential": "o"}


def draw(reached: list[ReachedError], random: list[dict[float, float]]) -> Figure:
    """Errors reached over errors asked for, a panel a scheme, and those of random scenes."""
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.8), sharey=True)
    asked = np.array(TOLERANCES)
    for ax, scheme, title in zip(axes[:2], (ESDIRK4, BACKWARD_EULER), ("ESDIRK4(3)", "backward Euler"), strict=True):
        ax.fill_between(asked, asked / 100, 3 * asked, color="0.9", label="at most three times the tolerance")
        ax.loglog(asked, asked, "k-", lw=0.6)
        for name, marker in MARKERS.items():
            mine = [run for run in reached if run.body == name and run.scheme is scheme]
            for quantity in mine[0].errors:
                filled, line = ("k", "--") if quantity == "area" else ("w", "-")
                style = {"marker": marker, "mfc": filled, "color": "k", "lw": 0.8, "ms": 5}
                errors = [run.errors[quantity] for run in mine]
                ax.loglog(asked[: len(errors)], errors, line, label=f"{name.replace('_', ', ')}: {quantity}", **style)
        ax.set(title=title, xlabel="tolerance asked for [-]")
    axes[2].fill_between(asked, asked / 100, 3 * asked, color="0.9")
    axes[2].loglog(asked, asked, "k-", lw=0.6)
    for run in random:
        axes[2].loglog(asked, [run[tolerance] * tolerance for tolerance in asked], "ko", mfc="w", ms=3, lw=0)
    axes[2].set(title=f"ESDIRK4(3), {len(random)} random scenes", xlabel="tolerance asked for [-]")
    axes[0].set(ylabel="largest error in time reached [-]")
    letter_panels(axes)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return figure
