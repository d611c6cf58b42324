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
        np.abs(vector.FV().NumPy(), out=self._work)
        self._work /= self._units
        return float(self._work.max())
