"""What leaves a scene undetermined, by name: motions that nothing holds, a pressure without a level, a singular system."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from netgen.meshing import NgException
from ngsolve import LinearForm, Mesh, Trace, dx
from numpy.typing import NDArray

from ngswell.mesh.points import vertices
from ngswell.physics.kinematics import Kinematics

if TYPE_CHECKING:
    from ngswell.problem.problem import Problem

NONE_LEFT = 1e-10
"""A null vector is one whose product leaves in no row more than this share of what its largest entry could make there."""


def connected_parts(mesh: Mesh) -> list[NDArray]:
    """Numbers of the vertices of each part of a mesh that edges connect."""
    ends = np.array([[vertex.nr for vertex in edge.vertices] for edge in mesh.edges])
    label = np.arange(mesh.nv)
    while True:
        least = label[ends].min(axis=1)
        if (label[ends] == least[:, None]).all():
            return [np.flatnonzero(label == number) for number in np.unique(label)]
        for side in ends.T:
            np.minimum.at(label, side, least)
        label = label[label]


def free_motion(kinematics: Kinematics, places: NDArray, held: list[tuple[int, int]]) -> str | None:
    """A rigid motion of a body with vertices at `places` that `held`, pairs (vertex, axis), leaves free; None if none is."""
    motions = _rigid_motions(kinematics, places)
    rows = np.array([motions[vertex, axis] for vertex, axis in held]).reshape(-1, motions.shape[2])
    _, sizes, modes = np.linalg.svd(rows)
    if int((sizes > 1e-9).sum()) == motions.shape[2]:
        return None
    return _name(kinematics, motions[:, :, int(np.argmax(np.abs(modes[-1])))])


def _rigid_motions(kinematics: Kinematics, places: NDArray) -> NDArray:
    """Displacements (vertex, axis, motion) of the rigid motions, about the middle and of the size 1."""
    centred = places - places.mean(axis=0)
    centred /= np.abs(centred).max() or 1.0
    return np.array([kinematics.rigid_motions(place) for place in centred])


def _name(kinematics: Kinematics, motion: NDArray) -> str:
    if (motion == motion[0]).all():
        return f"translate in {kinematics.directions[int(np.argmax(np.abs(motion[0])))]}"
    return "rotate"


def cannot_change_volume(mesh: Mesh, kinematics: Kinematics, held: dict[str, str], part: NDArray) -> bool:
    """Whether the sides of a part are held all around: ∫ div v = 0 for every displacement v that the supports allow."""
    space = kinematics.space(mesh, 1, held)
    v = space.TestFunction()
    flows = LinearForm(Trace(kinematics.gradient(v)) * kinematics.weight * dx).Assemble().vec.FV().NumPy()
    per_component = space.ndof // len(kinematics.directions)
    free = np.array(list(space.FreeDofs())).reshape(-1, per_component)[:, part]
    mine = np.abs(flows.reshape(-1, per_component)[:, part])
    return bool((mine * free).max() <= 1e-10 * mine.max())


UNDETERMINED = "Remedies: a support for what can move, a bath or a free side for a pressure."


def singular_mode(problem: Problem) -> str:
    """What the matrix of the present step leaves undetermined, in words; empty if it is regular to round-off.

    A solve with a matrix that is singular to round-off gives its null vector, times something large.
    """
    matrix = problem.linearise()
    rows, columns, values = (np.array(part) for part in matrix.COO())
    if not np.isfinite(values).all():
        return ""
    free = np.array(list(problem.free))
    size = np.empty(len(free))
    for name, reference in problem.references.items():
        size[problem.ranges[name]] = reference
    shares = np.where(free[rows] & free[columns], values * size[columns], 0.0)
    could = np.bincount(rows, np.abs(shares), len(free))
    # Some factorisations refuse what is singular; entries are in the order of COO.
    matrix.AsVector().FV().NumPy()[rows == columns] += 1e-13 * (could / size)[rows[rows == columns]]
    x, right = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    mode = np.random.default_rng(0).standard_normal(len(free)) * free
    try:
        inverse = matrix.Inverse(problem.free, inverse="umfpack")
    except NgException:
        return ""
    for _ in range(2):
        right.FV().NumPy()[:] = could * mode
        x.data = inverse * right
        mode = x.FV().NumPy() / size
        if not np.isfinite(mode).all():
            return ""
        mode /= np.abs(mode).max()
    left = np.bincount(rows, shares * mode[columns], len(free))
    if (np.abs(left) > NONE_LEFT * could).any():
        return ""
    return _described(problem, size * mode)


def _described(problem: Problem, mode: NDArray) -> str:
    name, where = problem.worst(mode)
    values = mode[problem.ranges[name]]
    if name == "u":
        axes = len(problem.kinematics.directions)
        at_vertices = values.reshape(axes, -1)[:, : problem.mesh.nv].T
        motions = _rigid_motions(problem.kinematics, vertices(problem.mesh))
        flat = motions.reshape(-1, motions.shape[2])
        shares = np.linalg.lstsq(flat, at_vertices.ravel(), rcond=None)[0]
        if np.abs(flat @ shares - at_vertices.ravel()).max() <= 1e-6 * np.abs(at_vertices).max():
            return f"the body can {_name(problem.kinematics, motions[:, :, int(np.argmax(np.abs(shares)))])}"
    elif np.ptp(values[: problem.mesh.nv]) <= 1e-6 * np.abs(values).max():
        return f"nothing determines the level of {name}"
    place = ", ".join(f"{x:.4g}" for x in where)
    return f"nothing determines {name} in a mode that is largest near ({place}) mm"
