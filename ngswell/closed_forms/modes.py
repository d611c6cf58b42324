"""What the series of linear poroelasticity share: roots, numbers of modes, moduli of small strains."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from ngswell.closed_forms.homogeneous import parameters
from ngswell.physics.material import Material
from ngswell.physics.solid import small_strain_moduli


def roots(function: Callable[[NDArray], NDArray], low: NDArray, high: NDArray) -> NDArray:
    """Bisection to round-off, all brackets at once."""
    sign = np.sign(function(low))
    for _ in range(60):
        middle = (low + high) / 2
        left = np.sign(function(middle)) == sign
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return (low + high) / 2


def terms(T: NDArray) -> int:
    """Number of modes, π apart, until exp(−α² T) falls below 1e-17."""
    return ceil(sqrt(40 / T.min()) / pi) + 1


def moduli(material: Material) -> tuple[float, float]:
    """µ and λ of small strains [N/mm²]."""
    parameters(material)
    return small_strain_moduli(material)


def confined_modulus(material: Material) -> float:
    """M = 2µ + λ, the stiffness in confined compression [N/mm²]."""
    mu, lam = moduli(material)
    return 2 * mu + lam
