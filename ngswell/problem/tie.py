"""What a force moves as one."""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import NDArray

from ngswell.schedules import Schedule


class Tie(NamedTuple):
    """Coefficients of the displacement that are one number, and the force over time that moves it."""

    dofs: NDArray
    force: Schedule
