"""One figure style, and fields on the deformed body."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.tri import Triangulation
from ngsolve import CF, ET, VOL, CoefficientFunction, IntegrationRule, x, y
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.models.solid_state import SolidState

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


def on_deformed_body(state: SolidState, field: CoefficientFunction, cuts: int = 3) -> Picture:
    """Sample `field` of a state (`result.state`) on the deformed cells of a 2-d mesh, each cut into `cuts`² pieces."""
    mesh = state.mesh
    if mesh.dim != 2:
        raise InputError("pictures of the deformed body need a 2-d mesh")
    triangles, places, values, outlines, count = [], [], [], [], 0
    for shape in (ET.QUAD, ET.TRIG):
        local, pieces, rim = _cut(shape, cuts)
        where = mesh.MapToAllElements({shape: IntegrationRule(local, [0.0] * len(local))}, VOL)
        if not len(where):
            continue
        deformed = (CF((x, y)) + state.u)(where)
        offsets = np.arange(0, len(deformed), len(local))
        triangles.append((count + offsets[:, None, None] + pieces).reshape(-1, 3))
        places.append(deformed)
        values.append(field(where).ravel())
        outlines.append(deformed[offsets[:, None] + rim])
        count += len(deformed)
    points = np.concatenate(places)
    triangulation = Triangulation(points[:, 0], points[:, 1], np.concatenate(triangles))
    return Picture(triangulation, np.concatenate(values), np.concatenate(outlines))


def _cut(shape: ET, cuts: int) -> tuple[list[tuple[float, float]], NDArray, NDArray]:
    """Points on the reference cell, the triangles between them, and the way round its rim, 4 `cuts` + 1 points."""
    steps = range(cuts + 1)
    grid = [(i, j) for i in steps for j in steps if shape == ET.QUAD or i + j <= cuts]
    number = {place: index for index, place in enumerate(grid)}
    pieces = [((i, j), (i + 1, j), (i, j + 1)) for i, j in grid]
    pieces += [((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i, j in grid]
    triangles = np.array([[number[corner] for corner in piece] for piece in pieces if all(c in number for c in piece)])
    if shape == ET.QUAD:
        turns = [(0, 0), (cuts, 0), (cuts, cuts), (0, cuts), (0, 0)]
    else:
        turns = [(0, 0), (cuts, 0), (0, cuts), (0, 0), (0, 0)]  # the last side stands still: rims have one length
    rim = [(a + (c - a) * k // cuts, b + (d - b) * k // cuts) for (a, b), (c, d) in pairwise(turns) for k in range(cuts)]
    return [(i / cuts, j / cuts) for i, j in grid], triangles, np.array([number[place] for place in [*rim, (0, 0)]])
