"""Whether a deformed body covers some place twice, where nothing keeps its parts apart, or is within an obstacle."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from ngsolve import VOL, ElementId
from numpy.typing import NDArray

from ngswell.calls import warn
from ngswell.errors import OverlapWarning, place
from ngswell.mesh.points import vertices
from ngswell.problem.discretisation import Discretisation
from ngswell.setup.snapshot import Snapshot

MOST_PAIRS = 4_000_000
"""Pairs of a cell and a side that are looked at; of larger bodies only some cells are, evenly spread."""

SOLVES = 100
"""Solves of a run between two looks: one costs less than a hundredth of them."""


@dataclass(frozen=True)
class Overlap:
    """How many of the cells `looked_at` lie within another part of the body, and one of them.

    `where` is its centre [mm] in the undeformed body, `now` in the deformed one.
    """

    cells: int
    looked_at: int
    where: tuple[float, ...]
    now: tuple[float, ...]

    def __str__(self) -> str:
        return (
            f"the body overlaps itself: {self.cells} of {self.looked_at} cells at its surface lie within another part, "
            f"such as the one from {place(self.where)} mm, now near {place(self.now)} mm"
        )


def overlap(discretisation: Discretisation, snapshot: Snapshot) -> Overlap | None:
    """Cells at the surface whose centre the deformed surface encloses twice; None without.

    The winding number of the surface about a place says how many times the body covers it: in 2-d the angles of its sides
    as seen from there, over 2π, in 3-d the solid angles, over 4π. Sides count as straight. An overlap less than half a cell
    deep is not seen. A column cannot overlap while J is positive.
    """
    mesh, dim = discretisation.mesh, discretisation.mesh.dim
    if dim == 1:
        return None
    reference = vertices(mesh)
    deformed = reference + discretisation.vertex_values(snapshot.values, discretisation.names[0]).T
    sides = discretisation.setup.sides
    behind = [[vertex.nr for vertex in mesh[ElementId(VOL, cell)].vertices] for cell in sides.behind.tolist()]
    centres, moved = (np.array([places[cell].mean(axis=0) for cell in behind]) for places in (reference, deformed))
    owner, corners = sides.simplices
    # The triangles of four corners cover their side twice.
    shares = np.array([0.5 if len(these) == 4 else 1.0 for these in sides.corners])[owner]
    outward = np.sign(np.linalg.det(reference[corners] - centres[owner, None]))
    step = 1 + len(moved) * len(corners) // MOST_PAIRS
    looked_at = np.unique(sides.behind, return_index=True)[1][::step]
    angles = np.array([_angles(deformed[corners] - moved[side]) @ (outward * shares) for side in looked_at])
    covered = looked_at[angles / (2 * pi if dim == 2 else 4 * pi) > 1.5]
    if not len(covered):
        return None
    where, now = (tuple(places[covered[0]].tolist()) for places in (centres, moved))
    return Overlap(len(covered), len(looked_at), where, now)


def _angles(corners: NDArray) -> NDArray:
    """Angle of segments, or solid angle of triangles, seen from the origin, with the sign of the corners' determinant."""
    volume = np.linalg.det(corners)
    if corners.shape[1] == 2:
        return np.arctan2(volume, (corners[:, 0] * corners[:, 1]).sum(axis=1))
    a, b, c = np.moveaxis(corners, 1, 0)
    sizes = np.linalg.norm(corners, axis=2)
    # Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125–126.
    products = (a * b).sum(axis=1) * sizes[:, 2] + (a * c).sum(axis=1) * sizes[:, 1] + (b * c).sum(axis=1) * sizes[:, 0]
    return 2 * np.arctan2(volume, sizes.prod(axis=1) + products)


def warn_of_overlap(discretisation: Discretisation, snapshot: Snapshot) -> bool:
    """Warn with OverlapWarning where the body overlaps itself, or what a load acts from, at a snapshot; whether it does."""
    found = overlap(discretisation, snapshot)
    if found is not None:
        text = (
            f"at t = {snapshot.time:.10g} s {found}. Contact is not modelled: from where parts meet on, states are not "
            "physical. Remedies: end the run before; a bath or supports with which they do not meet."
        )
        warn(OverlapWarning(text), discretisation.team)
    loads = discretisation.setup.loads
    state = discretisation.state_at(snapshot) if loads else None
    amiss = list(filter(None, (load.amiss(state, snapshot.time) for load in loads)))
    for what in amiss:
        warn(OverlapWarning(f"at t = {snapshot.time:.10g} s {what}"), discretisation.team)
    return found is not None or bool(amiss)


class OverlapWatch:
    """Looks now and then during a run, and at its end; warns once."""

    def __init__(self, discretisation: Discretisation) -> None:
        self._discretisation, self._found, self._looked = discretisation, False, 0

    def after_step(self, snapshot: Snapshot, solves: int) -> None:
        """An accepted state, and the solves of the run so far."""
        if solves >= self._looked + SOLVES:
            self._looked = solves
            self.look(snapshot)

    def look(self, snapshot: Snapshot) -> None:
        self._found = self._found or warn_of_overlap(self._discretisation, snapshot)
