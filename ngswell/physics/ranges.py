"""What parameters may be: units, possible (or, by orders of magnitude, plausible) ranges, hints."""

from __future__ import annotations

from typing import NamedTuple

from ngswell import checks
from ngswell.errors import InputError


class Range(NamedTuple):
    low: float
    high: float
    unit: str
    hint: str
    zero: bool = False


RANGES = {
    "mu": Range(1e-7, 1e4, "N/mm²", "1 N/mm² = 1 MPa = 1e6 Pa"),
    "lam": Range(1e-7, 1e5, "N/mm²", "1 N/mm² = 1 MPa = 1e6 Pa", zero=True),
    "nS0": Range(1e-6, 1 - 1e-6, "(a volume fraction)", "it lies strictly between 0 and 1"),
    "cfc0": Range(1e-12, 10.0, "mol/l", "1 mol/l = 1 meq/ml = 1000 mol/m³", zero=True),
    "D_plus": Range(1e-8, 1e-1, "mm²/s", "1 mm²/s = 1e-6 m²/s; salt in water has about 1e-3 mm²/s"),
    "D_minus": Range(1e-8, 1e-1, "mm²/s", "1 mm²/s = 1e-6 m²/s; salt in water has about 1e-3 mm²/s"),
    "K": Range(1e-11, 1e5, "mm⁴/(N s)", "1 mm⁴/(N s) = 1e-12 m⁴/(N s); K = kF/γFR"),
    "theta": Range(200.0, 500.0, "K", "0 °C = 273.15 K"),
    "phi": Range(0.05, 5.0, "(an osmotic coefficient)", "1 is the ideal solution"),
    "phi_bath": Range(0.05, 5.0, "(an osmotic coefficient)", "1 is the ideal solution"),
    "Gamma": Range(0.05, 20.0, "(a ratio of activity coefficients)", "bath over gel; 1 is the ideal solution"),
    "m": Range(0.0, 50.0, "(an exponent)", "0 leaves the permeability constant; below 0 it would grow on compaction"),
    "alpha": Range(0.0, 50.0, "(an exponent)", "0 keeps pores open; below 0 the permeability would grow on compaction"),
    "M": Range(0.0, 50.0, "(an exponent)", "0 leaves the power of the void ratio"),
}
ONE_NUMBER = {
    "theta": "theta has to be one number [K]: the model is isothermal",
    "phi": "phi has to be one number: the fluxes have it constant in the gel",
    "phi_bath": "phi_bath has to be one number: it belongs to the solution outside",
    "Gamma": "Gamma has to be one number: the fluxes have activity coefficients constant in the gel",
}


def within(name: str, value: object) -> float:
    """A parameter as a float, within its range."""
    low, high, unit, hint, zero = RANGES[name]
    if not checks.is_number(value):
        raise InputError(f"{name} has to be a number or a CoefficientFunction, got {checks.short(value)}")
    number = checks.as_float(value)
    if not (low <= number <= high or (zero and number == 0.0)):
        value = repr(number).removesuffix(".0")
        raise InputError(f"{name} = {value} {unit} is outside {low:g} … {high:g}{' or 0' if zero else ''}: {hint}")
    return number
