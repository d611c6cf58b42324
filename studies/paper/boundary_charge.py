"""Fig. 4: does it matter that the charge at the boundary follows the deformation?

A column of Table 1 in equilibrium with 0.15 mol/l; the bath on top falls to 0.125 mol/l within 10 s. Once the bath's Donnan
condition follows cfc(J) at the boundary, once the charge there stays at cfc0. Numbers, in mm:

- `following_final_mm`, `frozen_final_mm`: top displacement at rest;
- `closed_form_following_mm`, `closed_form_frozen_mm`: the same from equilibrium of a homogeneous confined column;
- `following_error`, `frozen_error`: relative difference of the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ngswell import BACKWARD_EULER, TABLE_1, Adaptive, Frozen, Penalty, Probe, Progress, Result
from ngswell.baths.treatment import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from studies.output import Findings, cost
from studies.scenes import COLUMN_HEIGHT, FALLING, P0, confined_column

AT_REST = 6000.0  # s, some thirty times the slowest relaxation time
TREATMENTS: dict[str, Treatment] = {"following": Penalty(1.0), "frozen": Frozen()}
BOUNDARY_CHARGES = {"following": None, "frozen": TABLE_1.cfc0}
LABELS = {"following": "charge at the boundary follows J", "frozen": "charge at the boundary frozen at $c^{fc}_0$"}


@dataclass(frozen=True)
class SwellingColumn:
    """Displacement of the top [mm] over time [s], the run, and the closed form at rest [mm]."""

    time: NDArray
    top: NDArray
    result: Result
    closed_form: float


def run(quick: bool = False) -> Findings:
    """Both columns, side by side."""
    cells, tolerance = (30, 1e-3) if quick else (60, 1e-4)
    columns = {name: compute(name, cells, tolerance) for name in TREATMENTS}
    rows = [
        (name, float(time), float(value.item()))
        for name, column in columns.items()
        for time, value in zip(column.time, column.top, strict=True)
    ]
    return Findings(draw(columns), ("boundary_charge", "time_s", "top_displacement_mm"), rows, numbers(columns, cells))


def compute(name: str, cells: int, tolerance: float) -> SwellingColumn:
    """One column to rest, and where it ends in closed form."""
    probe = Probe((COLUMN_HEIGHT,), "displacement")
    scene = confined_column(TREATMENTS[name], FALLING, cells)
    observers = [probe, Progress(f"boundary_charge {name}")]
    result = scene.run(AT_REST, Adaptive(tolerance, scheme=BACKWARD_EULER), observers)
    charge = BOUNDARY_CHARGES[name]
    rest = homogeneous_equilibrium(TABLE_1, FALLING.values[-1], "confined", load=P0, boundary_charge=charge)
    return SwellingColumn(probe.time, probe.values["displacement"], result, COLUMN_HEIGHT * (rest.J - 1))


def numbers(columns: dict[str, SwellingColumn], cells: int) -> dict[str, float | int | str]:
    """Both columns at rest against their closed forms."""
    found: dict[str, float | int | str] = {}
    for name, column in columns.items():
        final = float(column.top[-1].item())
        found |= {f"{name}_final_mm": final, f"closed_form_{name}_mm": column.closed_form}
        found[f"{name}_error"] = abs(final / column.closed_form - 1)
    return found | {"mesh": f"{cells} segments, order 2", **cost([column.result for column in columns.values()])}


def draw(columns: dict[str, SwellingColumn]) -> Figure:
    """Displacement of the top over time."""
    figure, axes = plt.subplots(figsize=(5.2, 3.4))
    for (name, column), style in zip(columns.items(), ("-", "--"), strict=True):
        axes.plot(column.time, column.top, "k" + style, label=LABELS[name])
        axes.axhline(column.closed_form, color="0.55", lw=0.8, ls=":")
    axes.annotate("closed forms", (1480, columns["frozen"].closed_form), (0, -4), textcoords="offset points",
                  ha="right", va="top", fontsize=8, color="0.35")  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="displacement of the top [mm]", xlim=(0, 1500), ylim=(0, None))
    axes.legend(loc="lower right")
    return figure
