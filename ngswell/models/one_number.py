"""An unknown of a run that is one number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ngsolve import CoefficientFunction


@dataclass(frozen=True)
class OneNumber:
    """An unknown beside the model's fields that is one number; the piece of a setup that needs it brings it.

    `name` is its own in the setup, and that of the balance tested with it; `size` its natural size and `start` its value at
    the start, in its unit. Where a content evolves it, its time error is relative to `evolves` times its size as long as
    it has changed by less, as in `Model.evolving`; None: it follows at once, as displacements do. With `positive` it stays
    above zero in every iterate.
    """

    name: str
    size: float
    start: float = 0.0
    evolves: float | None = None
    positive: bool = False


class Functions(NamedTuple):
    """An unknown in the forms: trial function, test function and the field of what is being computed."""

    trial: CoefficientFunction
    test: CoefficientFunction
    field: CoefficientFunction
