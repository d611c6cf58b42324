"""Displacements that supports prescribe: where, and what contradicts them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ngswell.baths.treatment import Surroundings
from ngswell.errors import InputError, place
from ngswell.mesh.points import vertices, vertices_of
from ngswell.schedules import Ramp, Schedule
from ngswell.setup.supports import Support

MOST = 10.0
"""Lengths of the body that a displacement may have. Beyond that its unit is not mm."""

STILL = Ramp((0.0, 0.0))
"""The history of what does not move."""


class Held(NamedTuple):
    """A direction that a support holds on a boundary ("a|b"), and the displacement there over time [mm].

    With a `force` over time the displacement there is an unknown, the same at all places.
    """

    support: Support
    direction: str
    boundary: str
    history: Schedule
    force: Schedule | None = None

    @property
    def moves(self) -> bool:
        return self.force is not None or any(self.history.values)

    def agrees(self, other: Held) -> bool:
        """Whether two hold what they share alike, as far as is known."""
        if self.support is other.support or not (self.moves or other.moves):
            return True
        return self.force is None and other.force is None and _same(self.history, other.history)

    def __str__(self) -> str:
        return f"{type(self.support).__name__} on {self.boundary!r}"


def held(supports: Sequence[Support], surroundings: Surroundings) -> Iterator[Held]:
    """All that supports hold on boundaries, in the order of the scene."""
    for support in supports:
        moving, forces = support.displacements(surroundings), support.forces(surroundings)
        for direction, boundary in support.fixed(surroundings).items():
            if boundary:
                yield Held(support, direction, boundary, moving.get(direction, STILL), forces.get(direction))


def by_direction(directions: str, found: Iterable[Held]) -> dict[str, str]:
    """The boundaries ("a|b") of each direction."""
    boundaries: dict[str, list[str]] = {direction: [] for direction in directions}
    for one in found:
        boundaries[one.direction].append(one.boundary)
    return {direction: "|".join(names) for direction, names in boundaries.items()}


def check_displacements(supports: Sequence[Support], surroundings: Surroundings, undeformed_at: float | None) -> None:
    """Refuse displacements that cannot be meant, or that contradict another support.

    At the time `undeformed_at` [s] the body starts undeformed; None where it starts from fields.
    """
    everything = list(held(supports, surroundings))
    moving = [one for one in everything if one.moves]
    if not moving:
        return
    corners = vertices(surroundings.mesh)
    longest = MOST * float(np.linalg.norm(np.ptp(corners, axis=0)))
    for one in moving:
        largest = max(one.history.values, key=abs)
        if abs(largest) > longest:
            raise InputError(
                f"{one}: its displacement goes to {largest:g} mm, more than {MOST:g} lengths of the body; it is in mm"
            )
        if undeformed_at is not None and (first := one.history.at(undeformed_at)) != 0:
            raise InputError(
                f"{one}: its displacement is {first:g} mm at the start ({undeformed_at:g} s), where the body is undeformed: "
                f"give a ramp, Ramp(({undeformed_at:g}, 0.0), ({undeformed_at + 1:g}, {first:g})); `equilibrate(time=...)` "
                "gives the state of rest at its end; a body that is there already goes on with `scene.after`"
            )
    _check_agreement(everything, [pin for support in supports for pin in support.pins(surroundings)], surroundings)


def _check_agreement(everything: list[Held], pins: list[tuple[int, str]], surroundings: Surroundings) -> None:
    """Refuse two displacements of one vertex in one direction."""
    found: dict[tuple[int, str], Held] = {}
    for one in everything:
        for vertex in vertices_of(surroundings.mesh, one.boundary):
            other = found.setdefault((vertex, one.direction), one)
            if not one.agrees(other):
                raise InputError(
                    f"{other} and {one} hold {_where(surroundings, vertex, one.direction)} differently: leave one of them "
                    "out, or give both the same displacement"
                )
    for vertex, direction in pins:
        if (vertex, direction) in found and (other := found[vertex, direction]).moves:
            raise InputError(
                f"{other} moves {_where(surroundings, vertex, direction)}, which a Pin holds: leave the Pin out"
            )


def _where(surroundings: Surroundings, vertex: int, direction: str) -> str:
    return f"the displacement in {direction} at the vertex {place(surroundings.mesh.vertices[vertex].point)} mm"


def _same(one: Schedule, other: Schedule) -> bool:
    """Whether two histories are known to be one."""
    values = {*one.values, *other.values}
    return len(values) == 1 or bool(type(one) is type(other) and one == other)
