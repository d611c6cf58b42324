"""Runge–Kutta schemes for S(x)˙ = −R(x, t): diagonally implicit, stiffly accurate, one matrix for all stages."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Scheme:
    """A tableau: row i of `rows` are the coefficients a_ij of stage i, the last row also weighs the stages.

    `embedded` are the weights of a second solution, one order lower, whose difference to the first estimates the error of
    a step; None leaves it to extrapolation from the step before. A first row of zero is an explicit stage: the state
    that the step starts from. All other stages have the same diagonal.
    """

    name: str
    order: int
    rows: tuple[tuple[float, ...], ...]
    embedded: tuple[float, ...] | None = None

    def __str__(self) -> str:
        return self.name

    @cached_property
    def times(self) -> tuple[float, ...]:
        """Where in the step the stages lie, as shares of it."""
        return tuple(sum(row) for row in self.rows)

    @property
    def weights(self) -> tuple[float, ...]:
        return self.rows[-1]

    @property
    def diagonal(self) -> float:
        return self.rows[-1][-1]

    @property
    def power(self) -> int:
        """Power of the step that the estimated error of a step goes with."""
        return max(self.order, 2)

    @property
    def explicit_start(self) -> bool:
        return self.rows[0] == (0.0,)

    def interpolation(self, share: float) -> NDArray:
        """Weights of the start and of the stages after it that give the state at `share` of a step.

        Backward Euler: on the line between the ends. With an explicit start: on the polynomial of degree 4 (of 6 stages)
        from which the state of stage i departs by a multiple of e_i, the same for all; those at the ends by none. Stages
        depart by x‴ Δt³ e_i, e_i = Σ_j a_ij c_j²/2 − c_i³/6, from x to fourth order; where rates are stiff by less. So
        values between are of third order or better, those at the ends as they are.
        """
        if not self.explicit_start:
            return np.array([1 - share, share])
        powers = np.arange(len(self.rows) - 1)
        return np.linalg.solve(self._departures, np.append(float(share) ** powers, 0.0))

    @cached_property
    def _departures(self) -> NDArray:
        """Rows: powers of the stages' times, and e."""
        c, count = np.array(self.times), len(self.rows)
        rows = np.array([[*row, *(0.0,) * (count - len(row))] for row in self.rows])
        departures = rows @ c**2 / 2 - c**3 / 6
        departures[-1] = 0.0  # to round-off it is
        return np.vstack([c ** np.arange(count - 1)[:, None], departures])

    @cached_property
    def difference(self) -> NDArray:
        """Weights of the error estimate: those of the solution less the embedded ones."""
        assert self.embedded is not None
        return np.array(self.weights) - np.array(self.embedded)


BACKWARD_EULER = Scheme("backward Euler", 1, ((1.0,),))
"""The paper's. Contents that have to stay positive do, which stages that weigh rates negatively do not promise."""

ESDIRK4 = Scheme(
    "ESDIRK4(3)",
    4,
    (
        (0.0,),
        (1 / 4, 1 / 4),
        (8611 / 62500, -1743 / 31250, 1 / 4),
        (5012029 / 34652500, -654441 / 2922500, 174375 / 388108, 1 / 4),
        (15267082809 / 155376265600, -71443401 / 120774400, 730878875 / 902184768, 2285395 / 8070912, 1 / 4),
        (82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211, 1 / 4),
    ),
    (
        4586570599 / 29645900160,
        0.0,
        178811875 / 945068544,
        814220225 / 1159782912,
        -3700637 / 11593932,
        61727 / 225920,
    ),
)
"""Fourth order with an embedded third: the implicit part of ARK4(3)6L[2]SA of Kennedy and Carpenter, Appl. Numer. Math. 44
(2003) 139. L-stable; stages of second order, which with moving prescribed values leaves between third and fourth."""
