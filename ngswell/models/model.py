"""A residual as named terms, and what a model offers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, runtime_checkable

from ngsolve import CoefficientFunction, FESpace, Mesh

from ngswell import checks
from ngswell.baths.bath import Bath, BathFields, Treatment
from ngswell.errors import InputError
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Field, Material
from ngswell.setup.supports import Weight


@dataclass(frozen=True)
class Term:
    """One named term of one balance.

    `kind` is "rate" (a content whose time derivative enters), "energy" (a density whose variation enters) or "form" (an
    integrand linear in the test functions). Integrated over `boundary` if that is named, else over the body. On a boundary,
    fields have tangential derivatives only, unless the term asks for `normal_derivatives`.
    """

    balance: str
    name: str
    integrand: CoefficientFunction
    kind: Literal["rate", "energy", "form"] = "form"
    boundary: str | None = None
    normal_derivatives: bool = False

    def __str__(self) -> str:
        return f"{self.balance}: {self.name}" + (f" [{self.boundary}]" if self.boundary else "")


@dataclass(frozen=True)
class Setting:
    """What the fields of a model live in: parameters and motion, the factor on cfc0, the weight, and the first bath."""

    material: Material
    kinematics: Kinematics
    charge: Field
    weight: Weight | None
    bath: BathFields | None


@runtime_checkable
class Model(Protocol):
    """A set of unknowns, the first the displacement: spaces, residual, boundary conditions, outputs."""

    @property
    def order(self) -> int: ...

    unknowns: ClassVar[tuple[str, ...]]
    balances: ClassVar[tuple[str, ...]]
    held: ClassVar[dict[str, str]]
    """The unknown whose test functions balance what the body holds: {"fluid": "p", ...}."""
    evolving: ClassVar[dict[str, float]]
    """Fields whose time error is controlled, with the fraction of their reference size that the error is relative to
    as long as they have changed by less."""
    treatments: ClassVar[tuple[type, ...]]
    """Treatments of a bath that the model knows, its default first."""

    def default_treatment(self) -> Treatment: ...

    def check(self, material: Material, baths: Sequence[Bath]) -> None:
        """Refuse materials and baths that the model cannot mean."""
        ...

    def space(self, mesh: Mesh, kinematics: Kinematics, held: dict[str, str], essential: str) -> FESpace:
        """Product space. `held` maps a direction to boundaries where u vanishes; on `essential` baths prescribe values."""
        ...

    def state(self, functions: Sequence[CoefficientFunction], setting: Setting) -> Any:
        """The fields that `functions` (trial functions or components of a result, one an unknown) stand for."""
        ...

    def equilibrium(self, bath: BathFields, cfc: CoefficientFunction, material: Material) -> dict[str, CoefficientFunction]:
        """Values of unknowns that equilibrium with a bath gives, for initial states and prescribed values."""
        ...

    def terms(self, state: Any, tests: Sequence[CoefficientFunction]) -> list[Term]:
        """The balances over the body, pulled back to the reference configuration."""
        ...

    def excess(self, state: Any, bath: BathFields) -> dict[str, CoefficientFunction]:
        """By how much unknowns exceed their equilibrium with a bath, by the balance that gets the efflux."""
        ...

    def references(self, concentration: float, stress: float, length: float) -> dict[str, float]:
        """Natural size of each unknown from the scene's largest concentration, shear modulus and length."""
        ...

    def bounds(self, state: Any) -> dict[str, CoefficientFunction]:
        """Concentrations that have to stay positive, by name; the fluid content has to in every model."""
        ...

    def solution_bounds(self, state: Any) -> dict[str, CoefficientFunction]:
        """What else has to be positive in a solution, though not in every iterate on the way to it."""
        ...


def needs_salt(model: str, baths: Sequence[Bath]) -> None:
    """Refuse baths without a salt concentration."""
    for bath in baths:
        if bath.c is None:
            raise InputError(f"bath on {bath.boundary!r}: {model} needs its salt concentration c [mol/l]")


def check_order(model: str, order: int) -> None:
    """Refuse orders that are not implemented."""
    if not (checks.is_a(order, int) and not isinstance(order, bool) and 2 <= order <= 6):
        shown = checks.shown(order)
        raise InputError(f"{model}(order={shown}): order 2 to 6 for u, a whole number; the other unknowns get one less")
