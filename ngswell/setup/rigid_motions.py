"""Whether supports and baths determine a body: motions that nothing holds, a pressure without a level."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from ngsolve import LinearForm, Mesh, Trace, dx
from numpy.typing import NDArray

from ngswell.errors import InputError, place
from ngswell.mesh.points import vertices, vertices_of
from ngswell.physics.kinematics import Kinematics
from ngswell.setup.displacements import Held, by_direction


def check_determined(
    mesh: Mesh,
    bodies: list[NDArray],
    kinematics: Kinematics,
    held: list[Held],
    pins: list[tuple[int, str]],
    wet: set[int],
) -> None:
    """Refuse parts of the body that are free to translate or rotate, or whose pressure has no level.

    `bodies` are the vertices of each part, `held` what supports hold on boundaries, `pins` pairs (vertex, direction), `wet`
    the vertices on baths. What a force moves as one is not fixed, but cannot turn.
    """
    places = vertices(mesh)
    fixed = by_direction(kinematics.directions, held)
    on_boundaries = [(vertices_of(mesh, one.boundary), kinematics.directions.index(one.direction), one) for one in held]
    fixed_pairs = {(number, axis) for numbers, axis, one in on_boundaries if one.force is None for number in numbers}
    tied_pairs = [[(n, axis) for n in sorted(numbers)] for numbers, axis, one in on_boundaries if one.force is not None]
    fixed_pairs |= {(number, kinematics.directions.index(direction)) for number, direction in pins}
    for body in bodies:
        where = place(places[body].mean(axis=0))
        what = "the body" if len(bodies) == 1 else f"the part near {where} mm, one of {len(bodies)} not connected,"
        number_in_part = {int(number): index for index, number in enumerate(body)}
        mine = [(number_in_part[number], axis) for number, axis in sorted(fixed_pairs) if number in number_in_part]
        tied = [[(number_in_part[n], axis) for n, axis in pairs if n in number_in_part] for pairs in tied_pairs]
        motion = free_motion(kinematics, places[body], mine, tied)
        if motion:
            raise InputError(f"{what} can {motion}: add a Roller, Symmetry or Pin")
        if wet.isdisjoint(number_in_part) and cannot_change_volume(mesh, kinematics, fixed, body):
            raise InputError(
                f"{what} has no bath and is held on all sides, so nothing determines the level of its pressure: "
                "give it a bath, or leave a side free"
            )


def free_motion(
    kinematics: Kinematics, places: NDArray, fixed: list[tuple[int, int]], tied: Sequence[list[tuple[int, int]]] = ()
) -> str | None:
    """A rigid motion of a body with vertices at `places` that `fixed`, pairs (vertex, axis), leaves free; else None.

    Each list of `tied` pairs has one displacement.
    """
    motions = rigid_motions(kinematics, places)
    if not motions.size:
        return None
    constraints = [motions[vertex, axis] for vertex, axis in fixed]
    constraints += [motions[pair] - motions[first] for first, *others in filter(None, tied) for pair in others]
    rows = np.array(constraints).reshape(-1, motions.shape[2])
    _, sizes, modes = np.linalg.svd(rows)
    if int((sizes > 1e-9).sum()) == motions.shape[2]:
        return None
    return name_of_motion(kinematics, motions[:, :, int(np.argmax(np.abs(modes[-1])))])


def rigid_motions(kinematics: Kinematics, places: NDArray) -> NDArray:
    """Displacements (vertex, axis, motion) of the rigid motions, about the middle and of the size 1."""
    centred = places - places.mean(axis=0)
    centred /= np.abs(centred).max() or 1.0
    return np.array([kinematics.rigid_motions(place) for place in centred])


def name_of_motion(kinematics: Kinematics, motion: NDArray) -> str:
    """What a rigid motion does: "translate in x", or "rotate"."""
    if (motion == motion[0]).all():
        return f"translate in {kinematics.directions[int(np.argmax(np.abs(motion[0])))]}"
    return "rotate"


def cannot_change_volume(mesh: Mesh, kinematics: Kinematics, fixed: dict[str, str], part: NDArray) -> bool:
    """Whether the sides of a part are held all around: ∫ div v = 0 for every displacement v that the supports allow."""
    space = kinematics.space(mesh, 1, fixed)
    v = space.TestFunction()
    flows = LinearForm(Trace(kinematics.gradient(v)) * kinematics.weight * dx).Assemble().vec.FV().NumPy()
    per_component = space.ndof // len(kinematics.directions)
    free = np.array(list(space.FreeDofs())).reshape(-1, per_component)[:, part]
    mine = np.abs(flows.reshape(-1, per_component)[:, part])
    return bool((mine * free).max() <= 1e-10 * mine.max())
