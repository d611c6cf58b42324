"""How large a correction is."""

from __future__ import annotations

import numpy as np
from ngsolve import BaseVector

from ngswell.problem.problem import Problem


class Size:
    """The largest coefficient of a vector, in `units` of each unknown."""

    def __init__(self, problem: Problem, units: dict[str, float]) -> None:
        self._units, self._work = np.empty(problem.space.ndof), np.empty(problem.space.ndof)
        for name, unit in units.items():
            self._units[problem.ranges[name]] = unit

    def __call__(self, vector: BaseVector) -> float:
        np.abs(vector.FV().NumPy(), out=self._work)
        self._work /= self._units
        return float(self._work.max())
