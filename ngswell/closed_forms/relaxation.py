"""Stress relaxation of linear biphasic bodies: a strain that rises at a constant rate and then stays.

As in `consolidation`: small strains, incompressible constituents, no charge, stress and strain positive in compression. With
T = c_v t/L² the stress after a unit step of strain is E + Σ c exp(−α² T). Under the rate ė from t = 0 to t₀ that gives

    σ = ė [E t + (L²/c_v) Σ c/α² (1 − exp(−α² T))],   then   σ = ė [E t₀ + (L²/c_v) Σ c/α² (exp(−α² (T − T₀)) − exp(−α² T))].
"""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ngswell import checks
from ngswell.calls import refusing
from ngswell.closed_forms.consolidation import consolidation_coefficient
from ngswell.closed_forms.modes import confined_modulus, moduli, roots
from ngswell.errors import InputError
from ngswell.physics.material import Material

MODES = 200
"""Modes of a series. c/α² falls with α⁻², confined, and α⁻⁴, unconfined."""

EARLIEST = 1e-4
"""Dimensionless time from which on the modes that are left out add up to less than 1e-10 of E."""


@refusing
def confined_relaxation(material: Material, strain: float, duration: float, height: float, time: ArrayLike) -> NDArray:
    """Stress [N/mm²] on the drained, moving end of a confined column. V. C. Mow et al., J. Biomech. Eng. 102 (1980) 73–84:

    E = 2µ + λ,   c = 2 E,   α = n π.   `strain` is reached at `duration` [s]; `time` [s] may be an array.
    """
    modulus, alpha = confined_modulus(material), np.arange(1, MODES + 1) * pi
    weights = np.full(MODES, 2 * modulus)
    return _ramped(material, strain, duration, height, time, (modulus, weights, modulus / 3, alpha))


@refusing
def unconfined_relaxation(material: Material, strain: float, duration: float, radius: float, time: ArrayLike) -> NDArray:
    """Mean stress [N/mm²] of a cylinder between rigid, smooth, sealed plates, drained at its side, where no load acts.
    C. G. Armstrong, W. M. Lai and V. C. Mow, J. Biomech. Eng. 106 (1984) 165–173:

        E = µ (2µ + 3λ)/(µ + λ),   c = 4µ²/[M α² − 4µ (1 − µ/M)],   M α J₀(α) = 2µ J₁(α),   M = 2µ + λ.

    A sudden strain meets 3µ. `strain` is reached at `duration` [s]; `time` [s] may be an array.
    """
    mu, lam = moduli(material)
    M = 2 * mu + lam
    order = np.arange(1, MODES + 1)
    low = np.where(order > 1, (order - 0.75) * pi - 0.2, 1e-3)  # from zeros of J₁ to those of J₀
    alpha = roots(lambda a: M * a * _bessel(0, a) - 2 * mu * _bessel(1, a), low, (order - 0.25) * pi + 0.1)
    weights = 4 * mu**2 / (M * alpha**2 - 4 * mu * (1 - mu / M))
    # Σ c/α² = dσ̂/dq² at q = 0 of σ̂ = 2µ + µ (M q I₀ − 4µ I₁)/(M q I₀ − 2µ I₁), from I₀ = 1 + q²/4, I₁ = q/2 + q³/16
    total = mu * ((M - mu) ** 2 - (M - 2 * mu) * (M - mu / 2)) / (4 * (M - mu) ** 2)
    return _ramped(material, strain, duration, radius, time, (mu * (2 * mu + 3 * lam) / (mu + lam), weights, total, alpha))


def _ramped(
    material: Material,
    strain: float,
    duration: float,
    length: float,
    time: ArrayLike,
    modes: tuple[float, NDArray, float, NDArray],
) -> NDArray:
    """The stress of `modes`: E, c, Σ c/α² and α."""
    checks.number("strain", strain)
    checks.positive("duration", duration, "s")
    checks.positive("height or radius", length, "mm")
    modulus, weights, total, alpha = modes
    unit = length**2 / consolidation_coefficient(material)
    times: NDArray = np.asarray(time, dtype=float)
    since_start, since_end = times / unit, (times - duration) / unit
    early = [(T > 0) & (T < EARLIEST) for T in (since_start, since_end)]
    if not (since_start >= 0).all() or np.any(early):
        raise InputError(
            f"time {time!r} s has to be at 0 or {duration:g} s, or so much later that c_v t / L² ≥ {EARLIEST:g}: the series "
            "converge from there on"
        )

    def left(T: NDArray) -> NDArray:
        """Σ c/α² exp(−α² T), its sum at T = 0 exact."""
        decayed = (weights / alpha**2 * np.exp(-(alpha**2) * np.maximum(T, 0.0)[..., None])).sum(axis=-1)
        return np.where(T > 0, decayed, total)

    return strain / duration * (modulus * np.minimum(times, duration) + unit * (left(since_end) - left(since_start)))


def _bessel(order: int, x: NDArray) -> NDArray:
    """J of an integer order: (1/π) ∫ cos(order θ − x sin θ) dθ over 0 … π, by a rule that converges like an exponential."""
    number = int(x.max()) + 60
    theta = (np.arange(number) + 0.5) * pi / number
    return np.cos(order * theta - x[..., None] * np.sin(theta)).mean(axis=-1)
