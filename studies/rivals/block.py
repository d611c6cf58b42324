"""The free-swelling block as data: constants, baths, mesh lines, where pressures are compared. Units mm, N, s, mol/l."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RT = 8.3144e-3 * 298
CFC0, NS0, MU, LAM, D_PLUS, D_MINUS, K = 0.8, 0.25, 0.12, 0.02, 0.5e-3, 0.8e-3, 1.07e-3
WIDTH, HEIGHT, BLENDED = 1.1, 1.0, 0.3
KINKS = (0.0, 4000.0, 7000.0, 7080.0, 7220.0, 8000.0, 10000.0, 11000.0)
"""Where charge and baths bend in time [s]."""

PICTURES = (7000.0, 7107.0, 7224.0, 7650.0, 11000.0)
"""Where pressures are compared [s]."""

SAMPLES = np.stack(
    np.meshgrid(WIDTH * (np.arange(24) + 0.497) / 24, HEIGHT * (np.arange(24) + 0.497) / 24), axis=-1
).reshape(-1, 2)
"""Where pressures are compared [mm]; off the lines of all meshes used."""


def charge(time: float) -> float:
    """Share of the fixed charge."""
    return min(time / 4000.0, 1.0)


def baths(time: float) -> tuple[float, float]:
    """Salt on top and left, and below [mol/l]."""
    side = np.interp(time, (7000.0, 7080.0, 7220.0), (4.1, 2.7, 0.3))
    bottom = np.interp(time, (7000.0, 7080.0, 8000.0, 10000.0), (4.1, 2.7, 2.7, 0.3))
    return float(side), float(bottom)


def bottom_share(x: NDArray, y: NDArray) -> NDArray:
    """How much of the bath below a boundary point has; the rest is that of the side."""
    below, left = y < 1e-9, x < 1e-9
    at_bottom = 1 - 0.5 * np.clip(1 - x / BLENDED, 0, 1)
    at_left = 0.5 * np.clip(1 - y / BLENDED, 0, 1)
    return np.where(below, at_bottom, np.where(left, at_left, 0.0))


@dataclass(frozen=True)
class Grid:
    """Cells along x and y, the largest over the smallest (thin ones at the baths), and the order of the displacement."""

    nx: int
    ny: int
    grade: float = 1.0
    order: int = 2

    def lines(self) -> tuple[NDArray, NDArray]:
        """Coordinates of the mesh lines [mm]. A graded mesh has lines where the baths bend."""
        up = np.arange(self.nx) / max(self.nx - 1, 1)
        both = np.minimum(np.arange(self.ny), self.ny - 1 - np.arange(self.ny)) / max((self.ny - 1) // 2, 1)
        across, along = _nodes(WIDTH, self.grade**up), _nodes(HEIGHT, self.grade**both)
        return (across, along) if self.grade == 1 else (_through(across), _through(along))


def _nodes(length: float, sizes: NDArray) -> NDArray:
    nodes = np.append(0.0, np.cumsum(sizes))
    return length * nodes / nodes[-1]


def _through(nodes: NDArray) -> NDArray:
    """With the inner node nearest to BLENDED moved there, the others stretched evenly."""
    nearest = nodes[1 + np.abs(nodes[1:-1] - BLENDED).argmin()]
    return np.interp(nodes, (0.0, nearest, nodes[-1]), (0.0, BLENDED, nodes[-1]))
