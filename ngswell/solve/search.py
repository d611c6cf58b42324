"""A line search by work, for solids whose stiffness jumps."""

from __future__ import annotations

from math import inf

import numpy as np
from ngsolve import BaseVector

from ngswell.problem.problem import Problem

ENOUGH = 0.2
"""Share of its work at the start of a correction that the residual of momentum may do at the part that is taken."""

MOST_TRIALS, MOST_HALVINGS = 40, 7
"""Parts of a correction that are tried, where its work counts and where it does not."""


def search(problem: Problem, correction: BaseVector, residual: BaseVector) -> bool:
    """Take the part of a correction along which the forces at rest do work; False, and nothing, if there is none.

    The slope of the energy along the correction, the residual of momentum times its displacements, falls from one end to the
    other where the energy is convex. Its root is bracketed: with fibres a thousand times as stiff as their ground, it is
    where the first of them have gone taut. Prescribed values that are not yet reached do work of their own; until they are,
    as much is taken as is admissible. `residual` is overwritten with that of the place.
    """
    vector, part = problem.vector, problem.ranges[problem.names[0]]
    start, full = vector.copy(), correction.FV().NumPy().copy()
    reached = not problem.gap().any()

    def work(share: float) -> float:
        vector[:] = start - share * full
        if problem.admissible.violation():
            return -inf
        problem.residual(residual)
        return float(np.dot(residual.FV().NumPy()[part], full[part]))

    if not reached:
        return any(np.isfinite(work(0.5**halvings)) for halvings in range(MOST_HALVINGS))
    low, high = 0.0, 1.0
    first = at_low = work(low)
    share, value, at_high = high, work(high), -inf
    for _ in range(MOST_TRIALS if first > 0 else 0):
        if abs(value) <= ENOUGH * first or (share == 1.0 and value > 0):
            return True
        if value > 0:
            low, at_low = share, value
        else:
            high, at_high = share, value
        root = at_low / (at_low - at_high) if np.isfinite(at_high) else 0.5
        share = low + (max(root, 1e-6) if low == 0 else min(max(root, 0.1), 0.9)) * (high - low)
        value = work(share)
    vector[:] = start
    return False
