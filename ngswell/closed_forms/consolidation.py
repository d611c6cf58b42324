"""Series of linear consolidation to compare with: Terzaghi's column, Mandel's slab, Cryer's sphere.

Small strains about the stress-free reference state, incompressible constituents, no charge. There the solid (18) has the
Lamé constants µ and λ, and the volume strain diffuses with c_v = K M, M = 2µ + λ. Loads are positive in compression.
Pressures are in excess of the bath's and, as loads, in N/mm². With the dimensionless time T = c_v t / L², each solution is a
sum of modes exp(−α² T), α the roots of an equation of its own.
"""

from __future__ import annotations

from math import inf, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ngswell.calls import refusing
from ngswell.closed_forms.modes import confined_modulus, moduli, roots, terms
from ngswell.errors import InputError
from ngswell.physics.material import Material

EARLIEST = 1e-8
"""Dimensionless time below which the series are refused: they would need more than 20 000 terms."""


@refusing
def consolidation_coefficient(material: Material) -> float:
    """c_v = K (2µ + λ) [mm²/s]."""
    return material.uniform_permeability() * confined_modulus(material)


@refusing
def terzaghi_pressure(material: Material, load: float, height: float, z: ArrayLike, time: ArrayLike) -> NDArray:
    """Excess pressure [N/mm²] at `z` [mm] above the sealed bottom of a confined column, loaded and drained at its top.

    K. Terzaghi, Erdbaumechanik (1925):  p = load Σ (2 sin α / α) cos(α z/h) exp(−α² T),   α = (n + ½) π.
    `z` and `time` [s] broadcast.
    """
    xi, T = _scaled(material, "height", height, z, time)
    alpha = _terzaghi_roots(T)
    return load * (2 * np.sin(alpha) / alpha * np.cos(alpha * xi) * np.exp(-(alpha**2) * T)).sum(axis=-1)


@refusing
def terzaghi_settlement(material: Material, load: float, height: float, time: ArrayLike) -> NDArray:
    """Downward displacement of the column's top [mm]:  load h/M [1 − Σ (2/α²) exp(−α² T)]."""
    _, T = _scaled(material, "height", height, 0.0, time)
    alpha = _terzaghi_roots(T)
    return load * height / confined_modulus(material) * (1 - (2 / alpha**2 * np.exp(-(alpha**2) * T)).sum(axis=-1))


@refusing
def mandel_pressure(material: Material, load: float, half_width: float, x: ArrayLike, time: ArrayLike) -> NDArray:
    """Excess pressure [N/mm²] at `x` [mm] from the middle of a slab in plane strain, squeezed between rigid, smooth, sealed
    plates by the mean stress `load`, drained at its free sides x = ±a.

    J. Mandel, Géotechnique 3 (1953) 287–299:

        p = load Σ sin α / (α − sin α cos α) [cos(α x/a) − cos α] exp(−α² T),   tan α = (M/µ) α.

    M/µ is (1 − ν)/(ν_u − ν) for ν_u = ½. The pressure starts at load/2.
    """
    xi, T = _scaled(material, "half_width", half_width, x, time)
    alpha, amplitude = _mandel_modes(material, T)
    return load * (amplitude * (np.cos(alpha * xi) - np.cos(alpha)) * np.exp(-(alpha**2) * T)).sum(axis=-1)


@refusing
def mandel_shortening(material: Material, load: float, half_width: float, time: ArrayLike) -> NDArray:
    """Compressive strain of Mandel's slab between the plates [-], uniform, with p̄ the mean pressure:

    e = [load M/(2µ) − p̄] / (2µ + 2λ),   from load/(4µ), undrained, on.
    """
    _, T = _scaled(material, "half_width", half_width, 0.0, time)
    alpha, amplitude = _mandel_modes(material, T)
    mean = load * (amplitude * (np.sin(alpha) / alpha - np.cos(alpha)) * np.exp(-(alpha**2) * T)).sum(axis=-1)
    mu, lam = moduli(material)
    return (load * (2 * mu + lam) / (2 * mu) - mean) / (2 * mu + 2 * lam)


@refusing
def cryer_pressure(material: Material, load: float, radius: float, r: ArrayLike, time: ArrayLike) -> NDArray:
    """Excess pressure [N/mm²] at `r` [mm] from the centre of a sphere, under the normal stress `load` and drained all over.

    C. W. Cryer, Q. J. Mech. Appl. Math. 16 (1963) 401–412. Equilibrium without rotation makes M ε − p uniform, so the
    volume strain ε diffuses; with q² = s R²/c_v the Laplace transform is

        p̂ = (load/s) [sinh q − (R/r) sinh(q r/R)] / [sinh q − η (q cosh q − sinh q)/q²],   η = 4µ/M,

    whose poles q = iα give

        p = load Σ 2 [sin α − (R/r) sin(α r/R)] / [α cos α + (2 − η) sin α] exp(−α² T),   (η − α²) tan α = η α.
    """
    xi, T = _scaled(material, "radius", radius, r, time)
    alpha, denominator = _cryer_modes(material, T)
    shape = np.sin(alpha) - alpha * np.sinc(alpha * xi / pi)
    return load * (2 * shape / denominator * np.exp(-(alpha**2) * T)).sum(axis=-1)


@refusing
def cryer_settlement(material: Material, load: float, radius: float, time: ArrayLike) -> NDArray:
    """Inward displacement of the surface of Cryer's sphere [mm]:

    load R { 1/(2µ + 3λ) + (1/2µ) Σ sin α / [α cos α + (2 − η) sin α] exp(−α² T) }.
    """
    _, T = _scaled(material, "radius", radius, 0.0, time)
    alpha, denominator = _cryer_modes(material, T)
    mu, lam = moduli(material)
    transient = (np.sin(alpha) / denominator * np.exp(-(alpha**2) * T)).sum(axis=-1) / (2 * mu)
    return load * radius * (1 / (2 * mu + 3 * lam) + transient)


# -- roots ---------------------------------------------------------------------------------------------------------------


def _terzaghi_roots(T: NDArray) -> NDArray:
    return (np.arange(terms(T)) + 0.5) * pi


def _mandel_modes(material: Material, T: NDArray) -> tuple[NDArray, NDArray]:
    """Roots of tan α = (M/µ) α, one in each (nπ, nπ + π/2) as M/µ > 1, and sin α / (α − sin α cos α)."""
    mu, lam = moduli(material)
    slope = (2 * mu + lam) / mu
    low = np.arange(terms(T)) * pi
    low[0] = 1e-3  # α = 0 is no mode, and the first root is at 1.17 or above
    alpha = roots(lambda a: np.sin(a) - slope * a * np.cos(a), low, np.arange(low.size) * pi + pi / 2)
    return alpha, np.sin(alpha) / (alpha - np.sin(alpha) * np.cos(alpha))


def _cryer_modes(material: Material, T: NDArray) -> tuple[NDArray, NDArray]:
    """Roots of (η − α²) tan α = η α, one in each (nπ − π/2, nπ) as η ≤ 2, and α cos α + (2 − η) sin α."""
    mu, lam = moduli(material)
    eta = min(2.0, 4 * mu / (2 * mu + lam))  # beyond by round-off, the first bracket would hold no root
    high = np.arange(1, terms(T) + 1) * pi
    alpha = roots(lambda a: (eta - a * a) * np.sin(a) - eta * a * np.cos(a), high - pi / 2, high)
    return alpha, alpha * np.cos(alpha) + (2 - eta) * np.sin(alpha)


# -- arguments -----------------------------------------------------------------------------------------------------------


def _scaled(material: Material, name: str, length: float, position: ArrayLike, time: ArrayLike) -> tuple[NDArray, NDArray]:
    """Dimensionless position and time, with a last axis for the modes."""
    if not 0 < length < inf:
        raise InputError(f"{name} = {length!r} mm has to be positive and finite")
    xi = np.asarray(position, dtype=float)[..., None] / length
    T = np.asarray(time, dtype=float)[..., None] * consolidation_coefficient(material) / length**2
    if not ((xi >= 0) & (xi <= 1 + 1e-12)).all():
        raise InputError(f"position {position!r} mm is outside the body: it runs from 0 to {name} = {length:g} mm")
    if not (T >= EARLIEST).all():
        raise InputError(f"time {time!r} s: the series converge for c_v t / L² ≥ {EARLIEST:g} only; give a later time")
    return xi, T
