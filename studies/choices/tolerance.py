"""What a tolerance means: errors in time reached by runs that ask for 1e-2 to 1e-5.

The column of Fig. 4, and the free-swelling block from rest at 7000 s to 11000 s on 8 × 8 cells, both models with their
default baths. Compared with the same mesh at a tolerance of 1e-7, which lands on all steps of the others. For each SCENE
(`column_` or `block_` and the model), TOLERANCE and QUANTITY (`displacement` of the column's top and of the block's top
corner; `area` of the block): `SCENE_TOLERANCE_QUANTITY_error`, the largest over all steps, relative to the largest
displacement or the initial area; `SCENE_TOLERANCE_steps`; `column_..._seconds` [s] of the time loop. The same for backward
Euler (`..._euler_...`), for comparison, and `largest_ratio`, `smallest_ratio`: errors reached over asked, of the scene's
larger error at each tolerance; `smallest_ratio_from_1e-3` without the tolerance of 1e-2.
"""

from __future__ import annotations

from collections.abc import Callable
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
    Newton,
    Penalty,
    Potential,
    Probe,
    Progress,
    Result,
    Scene,
)
from ngswell.models.model import Model
from ngswell.problem.problem import Snapshot
from ngswell.stepping.schemes import Scheme
from studies.output import Findings, cost
from studies.paper import boundary_charge, free_swelling
from studies.paper.free_swelling import END, HEIGHT, INITIAL, remodelled

MODELS = (Concentration(), Potential())
REFERENCE = 1e-7
EXACT = Newton(tolerance=1e-11, slowest=0.3)


@dataclass(frozen=True)
class Case:
    """A scene, where it starts and ends [s], what is watched there, and whether its area is."""

    name: str
    scene: Scene
    begin: Snapshot | None
    end: float
    corner: tuple[float, ...]

    def watch(
        self, steps: Adaptive, times: list[float] | None, newton: Newton | None = None
    ) -> tuple[NDArray, NDArray, Result]:
        """Times, and displacements and areas there (a row a time)."""
        area, corner = Area(when=times), Probe(self.corner, "displacement", when=times)
        label = f"tolerance {self.name} {steps.tolerance:g}"
        result = self.scene.run(self.end, steps, [area, corner, Progress(label)], newton=newton, resume=self.begin)
        moved = corner.values["displacement"].reshape(len(area.time), -1)
        return area.time, np.column_stack([moved, area.values]), result


def column(model: Model) -> Case:
    scene = remodelled(boundary_charge.scene(Penalty(1.0), 60), model)
    return Case(f"column_{type(model).__name__.lower()}", scene, None, 1500.0, (boundary_charge.HEIGHT,))


def block(model: Model, cells: int) -> Case:
    scene = remodelled(free_swelling.scene(cells, cells), model)
    name = f"block_{type(model).__name__.lower()}"
    return Case(name, scene, scene.equilibrate(INITIAL), END, (0.0, HEIGHT))


def run(quick: bool = False) -> Findings:
    """All scenes, tolerances and both schemes."""
    tolerances = (1e-2, 1e-3, 1e-4, 1e-5)
    makers: list[Callable[[Model], Case]] = [column, lambda model: block(model, 4 if quick else 8)]
    numbers: dict[str, float | int | str] = {}
    rows: list[tuple[object, ...]] = []
    results: list[Result] = []
    curves: dict[tuple[str, str, str], list[float]] = {}
    ratios: dict[float, list[float]] = {}
    for case in [make(model) for make in makers for model in MODELS]:
        runs = [
            (scheme, tolerance, case.watch(Adaptive(tolerance, scheme=scheme), None))
            for scheme in (ESDIRK4, BACKWARD_EULER)
            for tolerance in (tolerances if scheme is ESDIRK4 else tolerances[:1] if quick else tolerances[:3])
        ]
        times = sorted({float(time) for _, _, (when, _, _) in runs for time in when})
        exact_times, exact, _ = case.watch(Adaptive(REFERENCE), times, EXACT)
        size = [np.abs(exact[:, :-1]).max(), exact[0, -1]]
        for scheme, tolerance, (when, values, result) in runs:
            defect = np.abs(values - exact[np.searchsorted(exact_times, when)])
            errors = {"displacement": float(defect[:, :-1].max() / size[0]), "area": float(defect[:, -1].max() / size[1])}
            if case.name.startswith("column"):
                del errors["area"]  # its length
            key = f"{case.name}_{_short(scheme)}{tolerance:.0e}".replace("e-0", "e-")
            for quantity, error in errors.items():
                numbers[f"{key}_{quantity}_error"] = error
                curves.setdefault((case.name, _short(scheme), quantity), []).append(error)
            numbers[f"{key}_steps"] = len(result.steps)
            if case.name.startswith("column"):
                numbers[f"{key}_seconds"] = result.seconds
            if scheme is ESDIRK4:
                ratios.setdefault(tolerance, []).append(max(errors.values()) / tolerance)
            rows.append(
                (
                    case.name,
                    scheme.name,
                    tolerance,
                    errors["displacement"],
                    errors.get("area", ""),
                    len(result.steps),
                    result.seconds,
                )
            )
            results.append(result)
    of_all = [ratio for found in ratios.values() for ratio in found]
    numbers |= {"largest_ratio": max(of_all), "smallest_ratio": min(of_all)}
    numbers["smallest_ratio_from_1e-3"] = min(ratio for asked in tolerances[1:] for ratio in ratios[asked])
    numbers |= {"mesh": f"60 segments; {4 if quick else 8} x {4 if quick else 8} quadrilaterals", **cost(results)}
    header = ("scene", "scheme", "tolerance", "displacement_error", "area_error", "steps", "seconds")
    return Findings(draw(curves, tolerances), header, rows, numbers)


def _short(scheme: Scheme) -> str:
    return "" if scheme is ESDIRK4 else "euler_"


def draw(curves: dict[tuple[str, str, str], list[float]], tolerances: tuple[float, ...]) -> Figure:
    """Errors reached over errors asked for."""
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), sharey=True)
    asked = np.array(tolerances)
    markers = {"column_concentration": "v", "column_potential": "^", "block_concentration": "s", "block_potential": "o"}
    for ax, scheme, title in zip(axes, ("", "euler_"), ("ESDIRK4(3)", "backward Euler"), strict=True):
        ax.fill_between(asked, asked / 3, 3 * asked, color="0.9", label="within a factor of three")
        ax.loglog(asked, asked, "k-", lw=0.6)
        for (name, of, quantity), errors in curves.items():
            if of == scheme:
                filled = "k" if quantity == "area" else "w"
                style = {"marker": markers[name], "mfc": filled, "color": "k", "lw": 0.8, "ms": 5}
                line = "--" if quantity == "area" else "-"
                ax.loglog(asked[: len(errors)], errors, line, label=f"{name.replace('_', ', ')}: {quantity}", **style)
        ax.set(title=title, xlabel="tolerance asked for")
    axes[0].set(ylabel="largest error in time reached")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return figure
