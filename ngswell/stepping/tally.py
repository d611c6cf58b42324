"""How many steps a run took and why steps were rejected."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ngswell.files import Tree
from ngswell.stepping.steps import StepReport


class Tally:
    """Counts over accepted steps: `steps`, Newton `iterations`, and `rejected` steps by reason."""

    def __init__(self) -> None:
        self.steps = self.iterations = 0
        self._reasons: Counter[str] = Counter()

    def add(self, step: StepReport) -> None:
        self.steps += 1
        self.iterations += step.iterations
        self._reasons.update(rejection.reason.text(rejection.what) for rejection in step.rejected)

    @property
    def rejected(self) -> int:
        return self._reasons.total()

    @property
    def why(self) -> str:
        """The reasons of rejected steps, the most frequent first."""
        return ", ".join(f"{count} × {reason}" for reason, count in self._reasons.most_common())

    def state(self) -> Tree:
        return {
            "counts": np.array([self.steps, self.iterations]),
            "reasons": np.array(list(self._reasons), dtype=str),
            "rejected": np.array(list(self._reasons.values()), dtype=int),
        }

    def restore(self, state: Tree) -> None:
        self.steps, self.iterations = map(int, state["counts"].tolist())
        self._reasons = Counter(dict(zip(state["reasons"].tolist(), state["rejected"].tolist(), strict=True)))
