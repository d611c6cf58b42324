"""What a treatment of a bath is: the way in which Donnan equilibrium on the bath's boundary is imposed.

The condition p = p_D(c̄, cfc), c = c_D(c̄, cfc), eqs. (23), depends on the deformation through cfc. A treatment imposes it
weakly, as an efflux that the excess over equilibrium decides, or prescribes values with a charge known before the step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar, Protocol, runtime_checkable

from ngsolve import CoefficientFunction, GridFunction, Mesh, Norm, specialcf

from ngswell.baths.boundary import BathBoundary
from ngswell.checks import Field
from ngswell.models.model import Model
from ngswell.models.term import Role, Term
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material


class Charge(Enum):
    """Which fixed charge a condition knows."""

    PRESENT = "of the present deformation"
    LAST_STEP = "of the last accepted step"
    START = "of the start"


class Surroundings(Protocol):
    """What a piece of a setup may ask of it when it says its refusals."""

    @property
    def mesh(self) -> Mesh: ...

    @property
    def kinematics(self) -> Kinematics: ...

    @property
    def material(self) -> Material: ...

    @property
    def model(self) -> Model: ...

    @property
    def baths(self) -> Sequence[Any]: ...

    @property
    def loads(self) -> Sequence[Any]: ...

    @property
    def start(self) -> float:
        """When it starts [s]."""
        ...

    @property
    def origin(self) -> Any:
        """The snapshot that it starts from; None: the undeformed body."""
        ...

    def treatment(self, bath: Any) -> Treatment:
        """How equilibrium with a bath of the setup is imposed."""
        ...

    def fixed(self) -> dict[str, str]:
        """Boundaries ("a|b") on which each displacement component vanishes."""
        ...

    def check_boundary(self, what: str, boundary: str) -> list[str]:
        """The names in `boundary` ("a|b"); InputError for one that the mesh does not have."""
        ...

    def check_surface(self, what: str, boundary: str) -> list[str]:
        """The same, of the surface of the body; InputError for one inside it."""
        ...


@runtime_checkable
class Treatment(Protocol):
    """A way of imposing equilibrium; derive one of your own from `Weak` or `Prescribed`. Duties, numbered:

    1. `suits` says whether a model has what it needs;
    2. `charge_of` says which charge its condition knows: what remembers the past has no state of rest;
    3. `check_in` refuses setups that it cannot be used in;
    4. `__str__` completes the sentence "bath on top: …" of `describe()`.
    """

    charge_of: ClassVar[Charge]

    def suits(self, model: Model) -> bool: ...

    def check_in(self, surroundings: Surroundings, boundary: str) -> None: ...


@runtime_checkable
class Weak(Treatment, Protocol):
    """A treatment that adds terms to the balances.

    5. `terms` gives them, effluxes with `Role.EFFLUX`: ledgers go by the role;
    6. `multipliers` says whether the terms need one Lagrange multiplier a balance.
    """

    charge_of: ClassVar[Charge] = Charge.PRESENT
    multipliers: ClassVar[bool] = False

    def suits(self, model: Model) -> bool:
        return True

    def check_in(self, surroundings: Surroundings, boundary: str) -> None:
        return None

    def terms(self, contact: Contact) -> list[Term]: ...


@runtime_checkable
class Prescribed(Treatment, Protocol):
    """A treatment that prescribes values of the unknowns on the bath's boundary.

    5. `values` gives them, once a step (or stage), by unknown.
    """

    def check_in(self, surroundings: Surroundings, boundary: str) -> None:
        return None

    def values(self, on: PrescribedBoundary) -> dict[str, CoefficientFunction]: ...


@dataclass(frozen=True)
class Contact:
    """Body and bath on one boundary: what a weak treatment makes its terms of.

    `excess` are the unknowns less their equilibrium with the bath, by the balance that gets the efflux: p − p_D and c − c_D
    in `Concentration`, P − P̄ and c̃ − c̄ in `Potential`. `tests` and `multipliers` (trial, test) belong to the same balances.
    `h` is the mean size of the boundary's cells normal to it [mm], `order` that of the displacement; `conductances` are
    K/h [mm³/(N s)] and D₊/h [mm/s] with the largest values of these parameters: sizes, before any law. `receiving` are the
    test functions of the balances of a bath of finite volume, which gains what the gel loses; none for other baths.
    """

    boundary: str
    state: Any
    excess: dict[str, CoefficientFunction]
    tests: dict[str, CoefficientFunction]
    multipliers: dict[str, tuple[CoefficientFunction, CoefficientFunction]]
    h: float
    order: int
    conductances: dict[str, float]
    receiving: dict[str, CoefficientFunction] = field(default_factory=dict)

    @property
    def stretch(self) -> CoefficientFunction:
        """da/dA [-], from tangential derivatives."""
        return self.state.kinematics.area_stretch(self.state.u)

    def efflux(self, balance: str, flux: CoefficientFunction, in_cells: bool = False) -> Term:
        """The term of an efflux per current area: of fluid [mm/s], of cations [mol/l mm/s].

        `in_cells` evaluates it in the cells beside the boundary, as a flux that depends on J or on a field given by the
        domains of the mesh needs. That costs the elimination of what is inside cells.
        """
        if not in_cells:
            power = flux * self.exchange(balance) * self.stretch
            return Term(balance, "efflux", power, role=Role.EFFLUX, boundary=self.boundary)
        stretch = Norm(self.state.cofactor * self.state.kinematics.normal)
        return self.in_cells(balance, "efflux", flux * self.exchange(balance) * stretch, Role.EFFLUX)

    def exchange(self, balance: str) -> CoefficientFunction:
        """What an efflux is tested with: the gel loses it, and a bath of finite volume gains it."""
        test = self.tests[balance]
        return test - self.receiving[balance] if balance in self.receiving else test

    def effluxes(self, fluid: Field, cations: Field, in_cells: bool = False) -> list[Term]:
        """Effluxes that are so many times the excess: `fluid` [mm³/(N s)], `cations` [mm/s]; `in_cells` as in `efflux`."""
        factors = {"fluid": fluid, "cations": cations}
        return [self.efflux(balance, factors[balance] * value, in_cells) for balance, value in self.excess.items()]

    def in_cells(self, balance: str, name: str, integrand: CoefficientFunction, role: Role) -> Term:
        """A term per reference area of the boundary, evaluated in the cells beside it."""
        return Term(balance, name, integrand, role=role, boundary=self.boundary, normal_derivatives=True)


@dataclass(frozen=True)
class PrescribedBoundary:
    """A boundary on which a bath prescribes values: what `Prescribed.values` makes them of.

    `charge` is the field that the treatment asks for with `charge_of` (None where the model has none), `equilibrium` gives
    the values of the unknowns in equilibrium with the bath for a charge.
    """

    boundary: BathBoundary
    charge: GridFunction | None
    equilibrium: Callable[[Any], dict[str, CoefficientFunction]]


def normal_size(kinematics: Kinematics) -> CoefficientFunction:
    """Size normal to the boundary of the cell at a point, |Aᵀ N| for the map x = A ξ from the reference cell [mm].

    For integrals with normal derivatives. With the mean size, the penalty would be too weak for cells far below it.
    """
    dimension = kinematics.dimension
    return Norm(specialcf.JacobianMatrix(dimension).trans * specialcf.normal(dimension))
