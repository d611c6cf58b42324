"""The fields at one time, and what they mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from numpy.typing import NDArray


@dataclass(frozen=True)
class Snapshot:
    """The fields at one time [s]: what a run can go on from. `values` are all coefficients, in the order of the space.

    `meaning` says what they are coefficients of: mesh, model, order, unknowns. Only a scene with the same ones takes them.
    Without it, as of values made by hand, their number is all that can be compared; `dataclasses.replace(snapshot,
    values=...)` keeps it.
    """

    time: float
    values: NDArray = field(repr=False)
    meaning: Mapping[str, str] | None = field(default=None, repr=False)
