"""Material parameters with their units, checked; constitutive choices; the two tables of the paper."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import inf
from typing import Any, NamedTuple, Protocol, TypeAlias

from ngsolve import CF, VOL, CoefficientFunction, Mesh, exp

from ngswell import checks
from ngswell.errors import InputError
from ngswell.mesh.points import points

GAS_CONSTANT = 8.3144e-3
"""R [N/mm² per mol/l and K]."""

Field: TypeAlias = float | CoefficientFunction
"""A parameter: one number, or a CoefficientFunction of position in the reference configuration."""


class _Range(NamedTuple):
    low: float
    high: float
    unit: str
    hint: str
    zero: bool = False


_RANGES = {
    "mu": _Range(1e-7, 1e4, "N/mm²", "1 N/mm² = 1 MPa = 1e6 Pa"),
    "lam": _Range(1e-7, 1e5, "N/mm²", "1 N/mm² = 1 MPa = 1e6 Pa", zero=True),
    "nS0": _Range(1e-6, 1 - 1e-6, "(a volume fraction)", "it lies strictly between 0 and 1"),
    "cfc0": _Range(1e-12, 10.0, "mol/l", "1 mol/l = 1 meq/ml = 1000 mol/m³", zero=True),
    "D_plus": _Range(1e-9, 1e-1, "mm²/s", "1 mm²/s = 1e-6 m²/s; salt in water has about 1e-3 mm²/s"),
    "D_minus": _Range(1e-9, 1e-1, "mm²/s", "1 mm²/s = 1e-6 m²/s; salt in water has about 1e-3 mm²/s"),
    "K": _Range(1e-11, 1e5, "mm⁴/(N s)", "1 mm⁴/(N s) = 1e-12 m⁴/(N s); K = kF/γFR"),
    "theta": _Range(200.0, 500.0, "K", "0 °C = 273.15 K"),
    "phi": _Range(0.05, 5.0, "(an osmotic coefficient)", "1 is the ideal solution"),
    "phi_bath": _Range(0.05, 5.0, "(an osmotic coefficient)", "1 is the ideal solution"),
    "Gamma": _Range(0.05, 20.0, "(a ratio of activity coefficients)", "bath over gel; 1 is the ideal solution"),
    "m": _Range(0.0, 50.0, "(an exponent)", "0 leaves the permeability constant; below 0 it would grow on compaction"),
    "alpha": _Range(0.0, 50.0, "(an exponent)", "0 keeps pores open; below 0 the permeability would grow on compaction"),
    "M": _Range(0.0, 50.0, "(an exponent)", "0 leaves the power of the void ratio"),
}
_ONE_NUMBER = {
    "theta": "theta has to be one number [K]: the model is isothermal",
    "phi": "phi has to be one number: the fluxes have it constant in the gel",
    "phi_bath": "phi_bath has to be one number: it belongs to the solution outside",
    "Gamma": "Gamma has to be one number: the fluxes have activity coefficients constant in the gel",
}


class Permeability(Protocol):
    """K(J) from the parameter K = K0 [mm⁴/(N s)], J and nS0 [-], with K(1) = K0."""

    def __call__(self, K0: Field, J: Field, nS0: Field, /) -> Field: ...


class Diffusivity(Protocol):
    """D in the pore fluid from the parameter D0 [mm²/s] and the porosity nF [-]."""

    def __call__(self, D0: Field, nF: Field, /) -> Field: ...


@dataclass(frozen=True)
class Constant:
    """K = K0 or D = D0 whatever the deformation, as in the paper."""

    def __call__(self, value: Field, *state: Field) -> Field:
        return value


@dataclass(frozen=True)
class PowerLaw:
    """Permeability K = K0 [(J − nS0)/(1 − nS0)]^m, m ≥ 0 [-]; K → 0 at the compression point for m > 0.

    The bracket is the void ratio nF/nS over its initial value, as in B. Markert, Transp. Porous Media 70 (2007) 427. The
    power of the porosity nF/nF0 after G. Eipper (dissertation, Stuttgart 1998) lacks the factor J^m of this one.
    """

    m: float

    def __post_init__(self) -> None:
        checks.settle(self, m=_checked("m", self.m))

    def __call__(self, K0: Field, J: Field, nS0: Field) -> Field:
        return K0 * void_ratio(J, nS0) ** self.m


@dataclass(frozen=True)
class HolmesMow:
    """Permeability K = K0 [(J − nS0)/(1 − nS0)]^α exp[M (J² − 1)/2], α ≥ 0, M ≥ 0 [-].

    M. H. Holmes and V. C. Mow, J. Biomech. 23 (1990) 1145, for cartilage.
    """

    alpha: float
    M: float

    def __post_init__(self) -> None:
        checks.settle(self, alpha=_checked("alpha", self.alpha), M=_checked("M", self.M))

    def __call__(self, K0: Field, J: Field, nS0: Field) -> Field:
        return K0 * void_ratio(J, nS0) ** self.alpha * exp(self.M / 2 * (J * J - 1))


@dataclass(frozen=True)
class MackieMeares:
    """Diffusivity D = D0 [nF/(2 − nF)]²: the solid's chains lengthen the ions' paths.

    D_plus and D_minus are then those of the free solution, D0. J. S. Mackie and P. Meares, Proc. R. Soc. A 232 (1955) 498.
    """

    def __call__(self, D0: Field, nF: Field) -> Field:
        obstruction = nF / (2 - nF)
        return D0 * (obstruction * obstruction)


def void_ratio(J: Field, nS0: Field) -> Field:
    """nF/nS over its initial value, (J − nS0)/(1 − nS0) [-]; zero at the compression point."""
    return (J - nS0) / (1 - nS0)


@dataclass(frozen=True, kw_only=True)
class Material:
    """A charged hydrated porous solid and its pore fluid.

    The parameters up to K are floats or CoefficientFunctions of position in the reference configuration, the others are one
    number or one law; left out, they are the paper's. Raises InputError for a value outside its possible (or, by orders of
    magnitude, plausible) range; fields of position are checked when a scene brings the mesh.
    """

    mu: Field  # µS, shear modulus of the drained solid [N/mm²]
    lam: Field  # λS, second Lamé constant [N/mm²]
    nS0: Field  # nS0S, solidity of the reference configuration [-]
    cfc0: Field  # cfc0S, fixed charge per fluid volume of the reference configuration [mol/l]
    D_plus: Field  # D₊, cation diffusivity in the pore fluid (before a diffusivity law) [mm²/s]
    D_minus: Field  # D₋, anion diffusivity, likewise [mm²/s]
    K: Field  # kF/γFR, Darcy permeability over effective fluid weight, at J = 1 [mm⁴/(N s)]
    theta: float = 298.0  # θ, temperature [K]
    permeability: Permeability = Constant()  # K(J)
    diffusivity: Diffusivity = Constant()  # D₊(nF), D₋(nF)
    phi: float = 1.0  # φ, osmotic coefficient of the pore fluid [-]
    phi_bath: float = 1.0  # φ̄, osmotic coefficient of the bath [-]
    Gamma: float = 1.0  # Γ = γ̄/γ, mean activity coefficient of the salt in the bath over that in the gel [-]

    def __post_init__(self) -> None:
        reference = _sample("permeability", self.permeability, (1.0, 1.0, 0.5), "K(K0, J, nS0) such as PowerLaw(m=2.0)")
        if not abs(reference - 1) <= 1e-12:
            raise InputError(f"permeability = {self.permeability!r} gives K = {reference:g} K0 at J = 1; it has to give K0")
        diffusivity = _sample("diffusivity", self.diffusivity, (1.0, 0.5), "D(D0, nF) such as MackieMeares()")
        if not 0 < diffusivity < inf:
            raise InputError(
                f"diffusivity = {self.diffusivity!r} gives D = {diffusivity:g} D0 at nF = 0.5; it has to be positive"
            )
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in ("permeability", "diffusivity"):
                continue
            if isinstance(value, CoefficientFunction):
                if field.name in _ONE_NUMBER:
                    raise InputError(_ONE_NUMBER[field.name])
                check_scalar(field.name, value)
            else:
                checks.settle(self, **{field.name: _checked(field.name, value)})

    @property
    def RT(self) -> float:
        """Rθ [N/mm² per mol/l]."""
        return GAS_CONSTANT * self.theta

    def number(self, name: str) -> float:
        """The parameter `name` as one number, for closed forms; InputError if it is a field of position."""
        value = getattr(self, name)
        if isinstance(value, CoefficientFunction):
            raise InputError(f"{name} varies in space: closed forms hold for a homogeneous body, give a number")
        return float(value)

    def laws(self) -> dict[str, object]:
        """The constitutive choices that are not the paper's, by name."""
        names = ("permeability", "diffusivity", "phi", "phi_bath", "Gamma")
        return {name: getattr(self, name) for name in names if getattr(self, name) not in (Constant(), 1.0)}

    def check_on(self, mesh: Mesh) -> None:
        """Refuse fields of position whose values, at the quadrature points of `mesh`, are out of range."""
        where = points(mesh, VOL, 4)
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, CoefficientFunction):
                samples = value(where).ravel()
                _checked(field.name, float(samples.min()))
                _checked(field.name, float(samples.max()))

    def largest(self, name: str, mesh: Mesh) -> float:
        """Largest value of the parameter `name` over the quadrature points of `mesh`, in the parameter's unit."""
        value = getattr(self, name)
        return float(value(points(mesh, VOL, 4)).max()) if isinstance(value, CoefficientFunction) else float(value)


def _sample(name: str, law: Any, arguments: tuple[float, ...], example: str) -> float:
    """Value of a law, refused if it is none: it has to take numbers and fields."""
    try:
        law(*(CF(value) for value in arguments))
        return float(law(*arguments))
    except (TypeError, ValueError, ArithmeticError, AttributeError) as error:
        raise InputError(f"{name} = {checks.shown(law)} is not a law {example} of numbers and of fields: {error}") from None


def check_scalar(name: str, field: CoefficientFunction) -> None:
    """Refuse fields of vectors and of complex numbers."""
    if field.dim != 1 or field.is_complex:
        kind = "complex values" if field.is_complex else f"{field.dim} components"
        raise InputError(f"{name} has to be scalar and real, got a CoefficientFunction of {kind}")


def _checked(name: str, value: object) -> float:
    """A parameter as a float, within its range."""
    low, high, unit, hint, zero = _RANGES[name]
    if not checks.is_number(value):
        raise InputError(f"{name} has to be a number or a CoefficientFunction, got {checks.shown(value)}")
    number = checks.as_float(value)
    if not (low <= number <= high or (zero and number == 0.0)):
        value = repr(number).removesuffix(".0")
        raise InputError(f"{name} = {value} {unit} is outside {low:g} … {high:g}{' or 0' if zero else ''}: {hint}")
    return number


TABLE_1 = Material(mu=0.24, lam=0.02, nS0=0.25, cfc0=0.2, D_plus=0.5e-3, D_minus=0.8e-3, K=1.07e-3)
"""Table 1, the equilibrium test (Figs. 4 and 8). The charge printed in meq/l is in mol/l."""

TABLE_2 = Material(mu=0.12, lam=0.02, nS0=0.25, cfc0=0.8, D_plus=0.5e-3, D_minus=0.8e-3, K=1.07e-3)
"""Table 2, free swelling (Figs. 9 and 10). The charge printed in meq/l is in mol/l."""
