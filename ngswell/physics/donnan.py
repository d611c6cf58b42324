"""Donnan equilibrium of the charged gel with a monovalent salt bath, eqs. (23) and (38).

One formula serves floats, numpy arrays and NGSolve fields: nothing but arithmetic and a square root that knows all three.
"""

from __future__ import annotations

from typing import TypeVar

from ngsolve import CoefficientFunction, sqrt
from numpy.typing import NDArray

Value = TypeVar("Value", float, NDArray, CoefficientFunction)


def cations(salt: Value, cfc: Value, Gamma: float = 1.0) -> Value:
    """Cation concentration in equilibrium with a bath, c_D = sqrt((Γ c̄)² + cfc²/4) + cfc/2, eq. (23)₁ [mol/l].

    `salt` is the bath's concentration c̄ [mol/l], `cfc` the fixed charge per fluid volume [mol/l], `Gamma` the mean activity
    coefficient of the salt in the bath over that in the gel: equal activities are c₊ c₋ = (Γ c̄)². The paper has Γ = 1; its
    (32) as printed swaps the ¼ and the ½.
    """
    return _root(salt, cfc, Gamma) + cfc / 2


def anions(salt: Value, cfc: Value, Gamma: float = 1.0) -> Value:
    """Anion concentration c₋ = (Γ c̄)² / c_D [mol/l]; the quotient keeps its digits where c_D − cfc would lose them."""
    active = _times(Gamma, salt)
    return active * active / cations(salt, cfc, Gamma)


def pressure(
    salt: Value,
    cfc: Value,
    RT: float,
    hydraulic: Value | float = 0.0,
    Gamma: float = 1.0,
    phi: float = 1.0,
    phi_bath: float = 1.0,
) -> Value:
    """Overall pore pressure p_D = P̄ + 2 Rθ [φ sqrt((Γ c̄)² + cfc²/4) − φ̄ c̄], eqs. (23)₂ and (38) [N/mm²].

    `RT` is Rθ [N/mm² per mol/l], `hydraulic` the bath's hydraulic pressure P̄ [N/mm²], `phi` and `phi_bath` the osmotic
    coefficients of the pore fluid and of the bath, 1 in the paper.
    """
    return hydraulic + 2 * RT * (_times(phi, _root(salt, cfc, Gamma)) - _times(phi_bath, salt))


def _root(salt: Value, cfc: Value, Gamma: float) -> Value:
    """(c₊ + c₋)/2 [mol/l]."""
    active = _times(Gamma, salt)
    return sqrt(active * active + cfc * cfc / 4)


def _times(factor: float, value: Value) -> Value:
    """The product, without a factor of 1 in NGSolve's forms."""
    return value if factor == 1 else factor * value
