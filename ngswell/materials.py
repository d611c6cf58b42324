"""Material parameters with their units, checked; the two tables of the paper."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple, TypeAlias

import numpy as np
from ngsolve import VOL, CoefficientFunction, Mesh

from ngswell.errors import InputError
from ngswell.quadrature import points

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
    "nS0": _Range(0.0, 1.0, "(a volume fraction)", "it lies strictly between 0 and 1"),
    "cfc0": _Range(1e-12, 10.0, "mol/l", "1 mol/l = 1 meq/ml = 1000 mol/m³", zero=True),
    "D_plus": _Range(1e-9, 1e-1, "mm²/s", "1 mm²/s = 1e-6 m²/s; salt in water has about 1e-3 mm²/s"),
    "D_minus": _Range(1e-9, 1e-1, "mm²/s", "1 mm²/s = 1e-6 m²/s; salt in water has about 1e-3 mm²/s"),
    "K": _Range(1e-11, 1e5, "mm⁴/(N s)", "1 mm⁴/(N s) = 1e-12 m⁴/(N s); K = kF/γFR"),
    "theta": _Range(200.0, 500.0, "K", "0 °C = 273.15 K"),
}


@dataclass(frozen=True, kw_only=True)
class Material:
    """A charged hydrated porous solid and its pore fluid.

    Every parameter but the temperature is a float or a CoefficientFunction of position in the reference configuration.
    Raises InputError for a value outside its possible (or, by orders of magnitude, plausible) range; fields of position
    are checked when a scene brings the mesh.
    """

    mu: Field  # µS, shear modulus of the drained solid [N/mm²]
    lam: Field  # λS, second Lamé constant [N/mm²]
    nS0: Field  # nS0S, solidity of the reference configuration [-]
    cfc0: Field  # cfc0S, fixed charge per fluid volume of the reference configuration [mol/l]
    D_plus: Field  # D₊, cation diffusivity [mm²/s]
    D_minus: Field  # D₋, anion diffusivity [mm²/s]
    K: Field  # kF/γFR, Darcy permeability over effective fluid weight [mm⁴/(N s)]
    theta: float = 298.0  # θ, temperature [K]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, CoefficientFunction):
                if field.name == "theta":
                    raise InputError("theta has to be one number [K]: the model is isothermal")
                if value.dim != 1:
                    raise InputError(f"{field.name} has to be scalar, got a CoefficientFunction of {value.dim} components")
            else:
                _check(field.name, value)

    @property
    def RT(self) -> float:
        """Rθ [N/mm² per mol/l]."""
        return GAS_CONSTANT * self.theta

    def check_on(self, mesh: Mesh) -> None:
        """Refuse fields of position whose values, at the quadrature points of `mesh`, are out of range."""
        where = points(mesh, VOL, 4)
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, CoefficientFunction):
                samples = value(where).ravel()
                _check(field.name, float(samples.min()))
                _check(field.name, float(samples.max()))

    def largest(self, name: str, mesh: Mesh) -> float:
        """Largest value of the parameter `name` over the quadrature points of `mesh`, in the parameter's unit."""
        value = getattr(self, name)
        return float(value(points(mesh, VOL, 4)).max()) if isinstance(value, CoefficientFunction) else float(value)


def _check(name: str, value: object) -> None:
    low, high, unit, hint, zero = _RANGES[name]
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{name} has to be a number or a CoefficientFunction, got {value!r}")
    number = float(value)
    inside = low < number < high if name == "nS0" else low <= number <= high
    if not (inside or (zero and number == 0.0)):
        raise InputError(f"{name} = {number:g} {unit} is outside {low:g} … {high:g}{' or 0' if zero else ''}: {hint}")


TABLE_1 = Material(mu=0.24, lam=0.02, nS0=0.25, cfc0=0.2, D_plus=0.5e-3, D_minus=0.8e-3, K=1.07e-3)
"""Table 1, the equilibrium test (Figs. 4 and 8). The charge printed in meq/l is in mol/l."""

TABLE_2 = Material(mu=0.12, lam=0.02, nS0=0.25, cfc0=0.8, D_plus=0.5e-3, D_minus=0.8e-3, K=1.07e-3)
"""Table 2, free swelling (Figs. 9 and 10). The charge printed in meq/l is in mol/l."""
