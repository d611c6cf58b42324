"""What errors and corrections of a run are relative to: what the run itself does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ngswell.files import Tree
from ngswell.problem.problem import Problem
from ngswell.stepping.schemes import Scheme

ROUND_OFF = 1e-7
"""Share of a natural size below which a change counts as none."""


COUPLED = 0.1
"""Where the displacement changes by a share of its natural size, this part of it counts as a change of the others too: what
errors in pressure and concentration move is then still small."""

SAFETY, SAFETY_AFTER_KINK = 1.5, 15.0
"""What an estimate by the embedded solution is multiplied by; the second is for the displacement in the step after a kink.
There modes that are stiff at the step are off by (R(z) − e^z)/z, up to 16 times their estimate, (R(z) − R*(z))/(z − γz²): R
and R* of the scheme and of the embedded one. So are pressures and concentrations in layers at the bath, for a step; the
displacement is for longer. With these, random scenes reach errors of the displacement below 1.2 times the tolerance
(`python -m studies tolerance`)."""


def safety_of(scheme: Scheme, after_kink: bool) -> tuple[float, float]:
    """What estimates are multiplied by: that of the displacement, those of the other unknowns."""
    if not scheme.embedded:
        return 1.0, 1.0
    return SAFETY_AFTER_KINK if after_kink else SAFETY, SAFETY


class Sizes:
    """By evolving unknown, the largest change since the run began, as a root mean square of coefficients.

    It is the largest of what the run has passed so far, what is being attempted, and what is `expected` until the next kink.
    Where nothing is known of what is to come, a share of the natural size stands for it (`Model.evolving`).
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._begin = problem.vector.copy()
        self._passed = self._changes(self._begin)
        self._expected = self._natural()

    def state(self) -> Tree:
        """What a run remembers of it."""
        return {"begin": self._begin, "passed": self._passed, "expected": self._expected}

    def restore(self, state: Tree) -> None:
        """Go on from what `state` gave."""
        self._begin, self._passed, self._expected = state["begin"], state["passed"], state["expected"]

    def passes(self, values: NDArray) -> None:
        """Take note of a state that the run has passed."""
        self._passed = np.maximum(self._passed, self._changes(values))

    def expects(self, values: NDArray | None) -> None:
        """Take note of a state that is expected; None if nothing is known of it."""
        self._expected = self._natural() if values is None else self._changes(values)

    def relative(self, difference: NDArray, safety: tuple[float, float] = (1.0, 1.0)) -> float:
        """The largest root mean square of `difference`, a vector of all coefficients, in an attempt that the fields hold.

        That of the displacement counts times the first of `safety`, those of the others times the second.
        """
        shares = self._rms(difference) / self._sizes(self._changes(self.problem.vector))
        shares[0] *= safety[0]
        shares[1:] *= safety[1]
        return float(shares.max())

    def shares(self) -> dict[str, float]:
        """By unknown, the size over the natural size, at most 1; unknowns that do not evolve follow the displacement."""
        problem = self.problem
        evolving = dict(zip(problem.evolving, self._sizes(), strict=True))
        known = {name: min(1.0, float(size) / problem.references[name]) for name, size in evolving.items()}
        return {name: known.get(name, known[problem.names[0]]) for name in problem.names}

    def _sizes(self, *more: NDArray) -> NDArray:
        references = np.array([self.problem.references[name] for name in self.problem.evolving])
        own = np.maximum.reduce([self._passed, self._expected, *more]) / references
        return np.maximum(own, max(ROUND_OFF, COUPLED * own[0])) * references

    def _natural(self) -> NDArray:
        return np.array([share * self.problem.references[name] for name, share in self.problem.evolving.items()])

    def _changes(self, values: NDArray) -> NDArray:
        return self._rms(values - self._begin)

    def _rms(self, values: NDArray) -> NDArray:
        parts = (values[self.problem.ranges[name]] for name in self.problem.evolving)
        return np.array([np.sqrt(np.mean(part * part)) for part in parts])
