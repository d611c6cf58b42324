"""What a set of unknowns offers, and what its fields live in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

from ngsolve import CoefficientFunction, FESpace, Mesh

from ngswell import checks
from ngswell.checks import Field
from ngswell.errors import InputError
from ngswell.models.term import Term
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import NO_IONS, Material


class BathFields(NamedTuple):
    """A bath in the forms: salt concentration c̄ [mol/l] (None without ions) and hydraulic pressure P̄ [N/mm²]."""

    salt: CoefficientFunction
    P: CoefficientFunction


class BathData(Protocol):
    """What models check of a bath."""

    @property
    def boundary(self) -> str: ...

    @property
    def salt(self) -> Any:
        """History of its concentration; None for models without ions."""
        ...


@dataclass(frozen=True)
class FieldContext:
    """What the fields of a model live in.

    Parameters and motion, the factor on cfc0, the specific weight of the fluid [N/mm³] that drives seepage (None where the
    scene has none), and the first bath.
    """

    material: Material
    kinematics: Kinematics
    charge: Field
    fluid_weight: tuple[Field, ...] | None
    bath: BathFields | None


@runtime_checkable
class Model(Protocol):
    """A set of unknowns, the first the displacement. A model of one's own gives, numbered:

    1. `unknowns`, `order`, `space`: what is solved for;
    2. `balanced`, `evolving`, `charge_field`, `references`: which unknown balances what, what steps control, natural sizes;
    3. `check`: its refusals;
    4. `state`: fields and outputs, of trial functions and of results alike;
    5. `terms`: the balances over the body;
    6. `equilibrium`, `excess`: what a bath asks of it;
    7. `bounds`, `solution_bounds`: what has to stay positive; `positive`, `round_off`: unknowns that may vanish.
    """

    @property
    def order(self) -> int: ...

    unknowns: ClassVar[tuple[str, ...]]
    balanced: ClassVar[dict[str, str]]
    """The unknown whose test functions balance what the body holds: {"fluid": "p", ...}."""
    evolving: ClassVar[dict[str, float]]
    """Fields whose time error is controlled, with the fraction of their reference size that the error is relative to
    as long as they have changed by less."""
    charge_field: ClassVar[str | None]
    """The unknown that is a continuous field of the fixed charge; None where the charge is that of the point."""

    positive: ClassVar[tuple[str, ...]]
    """Unknowns that are positive at every vertex, in every iterate."""

    def check(self, material: Material, baths: Sequence[BathData]) -> None:
        """Refuse materials and baths that the model cannot mean."""
        ...

    def space(self, mesh: Mesh, kinematics: Kinematics, fixed: dict[str, str], prescribed: str) -> FESpace:
        """Product space. `fixed` maps a direction to boundaries where u vanishes; on `prescribed` baths prescribe values."""
        ...

    def state(self, functions: Sequence[CoefficientFunction], context: FieldContext) -> Any:
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

    def round_off(self, charge: float, RT: float) -> dict[str, float]:
        """What round-off leaves undetermined of unknowns where ions vanish beside a `charge` [mol/l]; `RT` is Rθ."""
        ...

    def bounds(self, state: Any) -> dict[str, CoefficientFunction]:
        """Concentrations that have to stay positive, by name; the fluid content has to in every model."""
        ...

    def solution_bounds(self, state: Any) -> dict[str, CoefficientFunction]:
        """What else has to be positive in a solution, though not in every iterate on the way to it."""
        ...


def needs_salt(model: str, baths: Sequence[BathData]) -> None:
    """Refuse baths without a salt concentration."""
    for bath in baths:
        if bath.salt is None:
            raise InputError(f"bath on {bath.boundary!r}: {model} needs its salt concentration c [mol/l]")


def needs_ions(model: str, material: Material) -> None:
    """Refuse a material without diffusivities."""
    if material.D_plus is None:
        raise InputError(f"{model}: {NO_IONS}")


def check_order(model: str, order: int) -> None:
    """Refuse orders that are not implemented."""
    if not (checks.is_a(order, int) and not isinstance(order, bool) and 2 <= order <= 6):
        shown = checks.short(order)
        raise InputError(f"{model}(order={shown}): order 2 to 6 for u, a whole number; the other unknowns get one less")
