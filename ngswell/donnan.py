"""Donnan equilibrium of the charged gel with a monovalent salt bath, eqs. (23) and (38).

One formula serves floats, numpy arrays and NGSolve fields: nothing but arithmetic and a square root that knows all three.
"""

from __future__ import annotations

from typing import TypeVar

from ngsolve import CoefficientFunction, sqrt
from numpy.typing import NDArray

Value = TypeVar("Value", float, NDArray, CoefficientFunction)


def cations(bath: Value, cfc: Value) -> Value:
    """Cation concentration in equilibrium with a bath, c_D = sqrt(c̄² + cfc²/4) + cfc/2, eq. (23)₁ [mol/l].

    `bath` is the salt concentration c̄ [mol/l], `cfc` the fixed charge per fluid volume [mol/l]. The printed (32) swaps
    the ¼ and the ½.
    """
    return sqrt(bath * bath + cfc * cfc / 4) + cfc / 2


def anions(bath: Value, cfc: Value) -> Value:
    """Anion concentration c₋ = c̄² / c_D [mol/l]; the quotient keeps its digits where c_D − cfc would lose them."""
    return bath * bath / cations(bath, cfc)


def pressure(bath: Value, cfc: Value, RT: float, hydraulic: Value | float = 0.0) -> Value:
    """Overall pore pressure p_D = P̄ + 2 Rθ [sqrt(c̄² + cfc²/4) − c̄], eqs. (23)₂ and (38) [N/mm²].

    `RT` is Rθ [N/mm² per mol/l], `hydraulic` the bath's hydraulic pressure P̄ [N/mm²].
    """
    return hydraulic + 2 * RT * (sqrt(bath * bath + cfc * cfc / 4) - bath)
