"""One figure style, and fields on the deformed body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.tri import Triangulation
from ngsolve import CF, ET, VOL, CoefficientFunction, IntegrationRule, x, y
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.problem import Problem

STYLE: dict[str, Any] = {
    "font.family": "serif",
    "mathtext.fontset": "dejavuserif",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "grid.color": "0.9",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "image.cmap": "cividis",  # its lightness is monotone: it survives a grey printer
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}
"""Matplotlib settings of all figures."""


def use_style() -> None:
    """Draw without a display, in the figures' style."""
    mpl.use("Agg")
    for key, value in STYLE.items():
        mpl.rcParams[key] = value  # type: ignore[index]


@dataclass(frozen=True)
class Picture:
    """A scalar field on the deformed body: triangles with their values, and the outline of every cell [mm]."""

    mesh: Triangulation
    values: NDArray
    outlines: NDArray

    def mirrored(self, axis: float) -> Picture:
        """The other half of a body that is symmetric to x = `axis` [mm]."""
        outlines = self.outlines.copy()
        outlines[..., 0] = 2 * axis - outlines[..., 0]
        mesh = Triangulation(2 * axis - self.mesh.x, self.mesh.y, self.mesh.triangles)
        return Picture(mesh, self.values, outlines)


def on_deformed_body(problem: Problem, field: CoefficientFunction, cuts: int = 3) -> Picture:
    """Sample `field` on the deformed cells of a 2-d mesh of quadrilaterals, each cut into `cuts`² pieces."""
    if problem.mesh.dim != 2 or any(element.type != ET.QUAD for element in problem.mesh.Elements(VOL)):
        raise InputError("pictures of the deformed body need a 2-d mesh of quadrilaterals")
    side = np.linspace(0.0, 1.0, cuts + 1)
    local = [(a, b) for b in side for a in side]
    where = problem.mesh.MapToAllElements({ET.QUAD: IntegrationRule(local, [0.0] * len(local))}, VOL)
    deformed = (CF((x, y)) + problem.state.u)(where)
    n = cuts + 1
    corner = np.array([row * n + column for row in range(cuts) for column in range(cuts)])
    halves = [np.stack([corner, corner + 1, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + n], 1)]
    offsets = np.arange(problem.mesh.ne) * len(local)
    triangles = (offsets[:, None, None] + np.concatenate(halves)).reshape(-1, 3)
    rim = [*range(cuts), *range(cuts, n * n - 1, n), *range(n * n - 1, n * cuts, -1), *range(n * cuts, -1, -n)]
    mesh = Triangulation(deformed[:, 0], deformed[:, 1], triangles)
    return Picture(mesh, field(where).ravel(), deformed[offsets[:, None] + np.array(rim)])
