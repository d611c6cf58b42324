"""A residual as named terms."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ngsolve import CoefficientFunction


class Kind(Enum):
    """How a term enters the residual."""

    RATE = "a content whose time derivative enters"
    ENERGY = "a density whose variation enters"
    FORM = "an integrand linear in the test functions"


class Role(Enum):
    """What a term does in its balance. Ledgers and the like go by it, never by a name."""

    INNER = "acts within the body"
    EFFLUX = "takes what leaves through a boundary out of the balance"
    ADJOINT = "keeps the form consistent or symmetric; it takes nothing out"
    CONDITION = "a condition of its own, tested beside the balances"
    LOAD = "a force from outside"
    CONTACT = "the force of what the body only touches"


@dataclass(frozen=True)
class Term:
    """One named term of one balance; `name` is for display.

    Integrated over `boundary` if that is named, else over the body. On a boundary, fields have tangential derivatives only,
    unless the term asks for `normal_derivatives`. A content that `lumps` is taken at vertices where its
    integrals fail. Derivatives of a `kinked` term jump with the unknowns. A term of very many parts, such as an energy of
    fibres in all directions, stays `apart` from the others: as one expression its derivatives would be too long.
    """

    balance: str
    name: str
    integrand: CoefficientFunction
    kind: Kind = Kind.FORM
    role: Role = Role.INNER
    boundary: str | None = None
    normal_derivatives: bool = False
    lumps: bool = False
    kinked: bool = False
    apart: bool = False

    def __str__(self) -> str:
        return f"{self.balance}: {self.name}" + (f" [{self.boundary}]" if self.boundary else "")
