"""A residual as named terms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ngsolve import CoefficientFunction


@dataclass(frozen=True)
class Term:
    """One named term of one balance.

    `kind` is "rate" (a content whose time derivative enters), "energy" (a density whose variation enters) or "form" (an
    integrand linear in the test functions). Integrated over `boundary` if that is named, else over the body.
    """

    balance: str
    name: str
    integrand: CoefficientFunction
    kind: Literal["rate", "energy", "form"] = "form"
    boundary: str | None = None

    def __str__(self) -> str:
        return f"{self.balance}: {self.name}" + (f" [{self.boundary}]" if self.boundary else "")
