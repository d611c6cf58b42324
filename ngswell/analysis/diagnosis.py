"""Why a step fails: what the state itself tells, a singular system or an instability."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from netgen.meshing import NgException
from ngsolve.la import SparseMatrixd
from numpy.typing import NDArray

from ngswell.analysis.causes import anions_are_spent, imbalance, oscillating, outrun, released
from ngswell.analysis.perturbations import Perturbations
from ngswell.errors import OF_IONS, UNCONVERGED, Failure, NgswellError, Reason, place
from ngswell.mesh.points import vertices
from ngswell.problem.problem import Problem
from ngswell.setup.rigid_motions import name_of_motion, rigid_motions
from ngswell.setup.snapshot import Snapshot

NONE_LEFT = 1e-10
"""A mode counts as a null vector when no row of its product exceeds this share of what the row's entries could add up to."""


@dataclass(frozen=True)
class Undetermined:
    """A null vector of a system: what kind of mode it is, in words, the unknown it lies in, and where it is largest [mm]."""

    class Kind(Enum):
        MOTION = "a rigid motion"
        LEVEL = "a constant"
        LOCAL = "a mode of its own"

    kind: Kind
    text: str
    field: str
    where: tuple[float, ...]

    @property
    def failure(self) -> Failure:
        return Failure(Reason.UNDETERMINED, self.field, self.where, self.text)


def explain(
    problem: Problem, snapshot: Snapshot, dt: float, failure: Failure, duration: float, first: bool, from_start: bool
) -> Failure | None:
    """What the state at `snapshot` says of a step of `dt` [s] from it that failed; None if nothing.

    A singular system, a bath that oscillates, a charge that rises too fast, a `first` state whose forces do not balance
    (or ions that run out after such a one, in a run `from_start` of the scene), or a state that is unstable within the
    `duration` [s] of the run. Not for systems too large for a factorisation, which the
    caller spares.
    """
    if failure.reason is Reason.NOT_ADMISSIBLE_AT_START:
        return None
    if problem.setup.looks_back:  # states have a map of their own
        return oscillating(problem, snapshot, dt)
    problem.restore(snapshot)
    problem.begin_step(snapshot.time + dt, dt)
    found = singular_mode(problem)
    problem.restore(snapshot)
    # Without fluid, the ions of a cell are undetermined too: that does not explain why fluid runs out.
    if found is not None and (failure.reason in UNCONVERGED or found.kind is not Undetermined.Kind.LOCAL):
        return found.failure
    if failure.reason in OF_IONS or (failure.reason in UNCONVERGED and anions_are_spent(problem)):
        charge = outrun(problem, snapshot, dt, failure)
        if charge is not None:
            return charge
        if failure.reason in OF_IONS:
            return released(problem, snapshot) if from_start else None
    out_of_balance = imbalance(problem) if first else None  # what is not at rest has no stability
    if out_of_balance is not None:
        return out_of_balance
    try:
        unstable = Perturbations(problem).fastest(1 / duration)
    except NgswellError:
        unstable = None
    return folded(problem) if unstable is None else Failure(Reason.UNSTABLE, "u", unstable.where, str(unstable))


def folded(problem: Problem) -> Failure | None:
    """Where the present state has a corner of a cell turned over, squeezed or not: its next steps may fail for that."""
    found = problem.admissible.turned(fluid=1.0)
    return None if found is None else Failure(found.reason, found.what, found.where, found.what)


def singular_mode(problem: Problem) -> Undetermined | None:
    """What the matrix of the present step leaves undetermined; None if it is regular to round-off.

    A solve with a matrix that is singular to round-off gives its null vector, times something large.
    """
    rows, columns, values = _entries(problem)
    if not np.isfinite(values).all():
        return None
    free = np.array(list(problem.free))
    size = problem.sizes
    shares = np.where(free[rows] & free[columns], values * size[columns], 0.0)
    could = np.bincount(rows, np.abs(shares), len(free))
    # Some factorisations refuse what is singular.
    raised = np.where(rows == columns, values + 1e-13 * (could / size)[rows], values)
    matrix = SparseMatrixd.CreateFromCOO(rows, columns, raised, len(free), len(free))
    x, right = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    mode = np.random.default_rng(0).standard_normal(len(free)) * free
    try:
        inverse = matrix.Inverse(problem.free, inverse="umfpack")
    except NgException:
        return None
    for _ in range(2):
        right.FV().NumPy()[:] = could * mode
        x.data = inverse * right
        mode = x.FV().NumPy() / size
        if not np.isfinite(mode).all():
            return None
        mode /= np.abs(mode).max()
    left = np.bincount(rows, shares * mode[columns], len(free))
    if (np.abs(left) > NONE_LEFT * could).any():
        return None
    return _described(problem, size * mode)


def _entries(problem: Problem) -> tuple[NDArray, NDArray, NDArray]:
    """Rows, columns and values of the entries of the present step's matrix, over all ranks."""
    shares = problem.team.each([np.array(part) for part in problem.linearise().COO()])
    rows, columns, values = (np.concatenate(parts) for parts in zip(*shares, strict=True))
    size = problem.space.ndof
    entries, places = np.unique(rows.astype(np.int64) * size + columns, return_inverse=True)
    return (entries // size).astype(np.int32), (entries % size).astype(np.int32), np.bincount(places, values)


def _described(problem: Problem, mode: NDArray) -> Undetermined:
    name, where = problem.worst(mode)
    at_vertices = problem.vertex_values(mode, name).T
    largest = np.abs(mode[problem.ranges[name]]).max()
    if name == problem.names[0]:
        motions = rigid_motions(problem.kinematics, vertices(problem.mesh))
        flat = motions.reshape(-1, motions.shape[2])
        shares = np.linalg.lstsq(flat, at_vertices.ravel(), rcond=None)[0]
        if np.abs(flat @ shares - at_vertices.ravel()).max() <= 1e-6 * np.abs(at_vertices).max():
            motion = name_of_motion(problem.kinematics, motions[:, :, int(np.argmax(np.abs(shares)))])
            return Undetermined(Undetermined.Kind.MOTION, f"the body can {motion}", name, where)
    elif np.ptp(at_vertices) <= 1e-6 * largest:
        return Undetermined(Undetermined.Kind.LEVEL, f"nothing determines the level of {name}", name, where)
    text = f"nothing determines {name} in a mode that is largest near {place(where)} mm"
    return Undetermined(Undetermined.Kind.LOCAL, text, name, where)
