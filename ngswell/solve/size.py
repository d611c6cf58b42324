"""How large a correction is."""

from __future__ import annotations

import numpy as np
from ngsolve import BaseVector

from ngswell.problem.per_unknown import of_coefficients
from ngswell.problem.problem import Problem


class Size:
    """The largest coefficient of a vector, in `units` of each unknown."""

    def __init__(self, problem: Problem, units: dict[str, float]) -> None:
        self._units, self._work = of_coefficients(problem.ranges, units), np.empty(problem.space.ndof)

    def __call__(self, vector: BaseVector) -> float:
        scaled = np.divide(vector.FV().NumPy(), self._units, out=self._work)
        return float(max(scaled.max(), -scaled.min()))


class MeanSize:
    """The largest root mean square of an unknown's coefficients, in `units` of each unknown."""

    def __init__(self, problem: Problem, units: dict[str, float]) -> None:
        parts = sorted((part.start, part.stop) for part in problem.ranges.values() if part.stop > part.start)
        self._starts, stops = np.array(parts).T
        self._counts = stops - self._starts
        self._units, self._work = of_coefficients(problem.ranges, units), np.empty(problem.space.ndof)

    def __call__(self, vector: BaseVector) -> float:
        scaled = np.divide(vector.FV().NumPy(), self._units, out=self._work)
        np.square(scaled, out=scaled)
        return float(np.sqrt((np.add.reduceat(scaled, self._starts) / self._counts).max()))
