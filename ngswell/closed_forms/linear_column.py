"""The linearised triphasic column and the uniform gel between two baths, in closed form. Derivation: docs/linear_column.md.

About the charged, stress-free reference state in equilibrium with a bath c̄, in the potentials that are continuous across
the boundary (differences to that state, Rθ in N/mm² per mol/l):

    P = p − Rθ (2c − cfc)   hydraulic pressure [N/mm²],      Σ = 2 Rθ ln c̃, c̃² = c (c − cfc)   of the salt [N/mm² per mol/l],

the contents J and n = (J − nS0) c and the fluxes relative to the solid are

    (δJ, δn) = C (P, Σ),      (nF wF, nF c₊ w₊) = −L ∂(P, Σ)/∂x,      C ∂w/∂t = L ∂²w/∂x²,   w = (P, Σ),

with symmetric positive definite C and L: all perturbations decay, at real rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ngswell import checks
from ngswell.baths.bath import checked_salt
from ngswell.calls import refusing
from ngswell.closed_forms.homogeneous import parameters
from ngswell.errors import InputError
from ngswell.physics.material import Material
from ngswell.physics.solid import small_strain_moduli

TERMS = 4000
"""Modes in a sum. What they leave out has decayed below 1e-17 for times beyond 3e-7 height²/κ, and in backward Euler is
below 1e-13 height²/(κ step) of the top's displacement."""


class _Gel(NamedTuple):
    """Numbers of the reference state: ions c₊, c₋ and their sum s [mol/l], nF, H = 2µ + λ [N/mm²], 2 c̄²/s [mol/l]."""

    plus: float
    minus: float
    total: float
    cfc0: float
    nF: float
    H: float
    RT: float
    share: float
    D_plus: float
    D_minus: float
    K: float


def _gel(material: Material, bath: float) -> _Gel:
    nS0, cfc0 = parameters(material)
    mu, lam = small_strain_moduli(material)
    D_plus, D_minus, K = material.number("D_plus"), material.number("D_minus"), material.uniform_permeability()
    bath = checked_salt("bath", bath)
    total = sqrt(4 * bath * bath + cfc0 * cfc0)
    plus = (total + cfc0) / 2
    minus = bath * bath / plus
    share = 2 * bath * bath / total
    return _Gel(plus, minus, total, cfc0, 1 - nS0, 2 * mu + lam, material.RT, share, D_plus, D_minus, K)


@refusing
def storage(material: Material, bath: float) -> NDArray:
    """C: contents (J [-], n [mol/l]) per potential (P, Σ) in a confined motion under a constant load.

        C = [[1/A, b/A], [b/A, b²/A + nF b/(2 Rθ)]],   b = 2 c̄²/s,   A = 2µ + λ + Rθ cfc0²/(nF s),   s = c₊ + c₋.

    A is the stiffness at constant bath, the second part of it osmotic [N/mm²].
    """
    g = _gel(material, bath)
    stiffness = g.H + g.RT * g.cfc0**2 / (g.nF * g.total)
    coupled = np.array([[1.0, g.share], [g.share, g.share**2]]) / stiffness
    return coupled + np.array([[0.0, 0.0], [0.0, g.nF * g.share / (2 * g.RT)]])


@refusing
def conductance(material: Material, bath: float) -> NDArray:
    """L: fluxes (nF wF [mm/s], nF c₊ w₊ [mol/l mm/s]) per falling gradient of (P, Σ), eqs. (19) to (22) without current.

        L = K_e [[1, c*], [c*, c*²]] + [[0, 0], [0, a₊ a₋/(a₊ + a₋)]],   a± = nF D± c±/Rθ,
        K_e = K / [1 + K cfc²/(a₊ + a₋)],   c* = (c₊ a₋ + c₋ a₊)/(a₊ + a₋).

    K_e is K less what the streaming potential holds back, c* the salt that the fluid carries: 1 − c*/c̄ is the reflection
    coefficient, negative where osmosis is.
    """
    g = _gel(material, bath)
    a_plus, a_minus = g.nF * g.D_plus * g.plus / g.RT, g.nF * g.D_minus * g.minus / g.RT
    K_e = g.K / (1 + g.K * g.cfc0**2 / (a_plus + a_minus))
    carried = (g.plus * a_minus + g.minus * a_plus) / (a_plus + a_minus)
    convection = K_e * np.array([[1.0, carried], [carried, carried**2]])
    return convection + np.array([[0.0, 0.0], [0.0, a_plus * a_minus / (a_plus + a_minus)]])


@refusing
def potentials(material: Material, bath: float, salt: float = 0.0, hydraulic: float = 0.0) -> NDArray:
    """(P, Σ) of a bath whose concentration differs by `salt` [mol/l] and pressure by `hydraulic` [N/mm²] from c̄, P̄:

    P = δP̄ − 2 Rθ δc̄,   Σ = 2 Rθ δc̄/c̄.     No deformation enters.
    """
    RT = _gel(material, bath).RT
    return np.array([hydraulic - 2 * RT * salt, 2 * RT * salt / bath])


@refusing
def penalty_efflux(material: Material, bath: float, relative: float, cell: float) -> NDArray:
    """G: effluxes (fluid [mm/s], cations [mol/l mm/s]) per excess of (P, Σ) over a bath with `Penalty(relative=...)`.

        G = [[ε_p, ε_p b], [0, ε_c b/(2 Rθ)]],   ε_p = relative K/h,   ε_c = relative D₊/h,   cells of h = `cell` [mm];

    at the same charge p − p_D = P + b Σ and c − c_D = b Σ/(2 Rθ).
    """
    checks.positive("relative", relative)
    checks.positive("cell", cell)
    g = _gel(material, bath)
    return relative / cell * np.array([[g.K, g.K * g.share], [0.0, g.D_plus * g.share / (2 * g.RT)]])


@refusing
def diffusivities(storage: NDArray, conductance: NDArray) -> tuple[NDArray, NDArray]:
    """Eigenvalues κ [mm²/s] of L v = κ C v, ascending, and the modes v in columns, with vᵀ C v = 1."""
    root = np.linalg.inv(np.linalg.cholesky(storage))
    values, vectors = np.linalg.eigh(root @ conductance @ root.T)
    return values, root.T @ vectors


@refusing
def uniform_gel_fluxes(
    material: Material, bath: float, thickness: float, salt: float = 0.0, hydraulic: float = 0.0
) -> tuple[float, float]:
    """Steady fluxes (nF wF [mm/s], nF c₊ w₊ [mol/l mm/s]) through a rigid gel between two baths of nearly `bath` [mol/l].

    `salt` [mol/l] and `hydraulic` [N/mm²] are the differences of the bath that fluxes point away from less that of the
    other, `thickness` their distance [mm]:  L (P, Σ)/thickness.
    """
    checks.positive("thickness", thickness)
    fluid, cations = conductance(material, bath) @ potentials(material, bath, salt, hydraulic) / thickness
    return float(fluid), float(cations)


@refusing
@dataclass(frozen=True)
class LinearColumn:
    """A confined column on a sealed, fixed bottom x = 0 in equilibrium with a `bath` [mol/l] on top, x = `height` [mm].

    Its load holds the reference state and stays: a porous plate carries P̄ (without, δP̄ adds to p alone).
    Responses are to a sudden small change of the bath at t = 0; they take `step` [s] to follow backward Euler with that
    step, 1/(1 + rate step)^k at t = k step in place of exp(−rate t).
    """

    material: Material
    bath: float
    height: float

    def __post_init__(self) -> None:
        _gel(self.material, self.bath)
        checks.positive("height", self.height)

    @cached_property
    def storage(self) -> NDArray:
        """C, see `storage`."""
        return storage(self.material, self.bath)

    @cached_property
    def conductance(self) -> NDArray:
        """L, see `conductance`."""
        return conductance(self.material, self.bath)

    @cached_property
    def _modes(self) -> tuple[NDArray, NDArray]:
        return diffusivities(self.storage, self.conductance)

    @cached_property
    def fields(self) -> dict[str, NDArray]:
        """Rows that take (P, Σ) to the changes of J [-], p [N/mm²], cfc and c₊ [mol/l]; names as in `Probe`."""
        g = _gel(self.material, self.bath)
        J = self.storage[0]
        cfc = -g.cfc0 / g.nF * J
        total = np.array([0.0, g.share / g.RT]) + g.cfc0 / g.total * cfc
        return {"J": J, "p": g.H * J, "cfc": cfc, "c_plus": (total + cfc) / 2}

    def decay_rates(self, count: int = 1) -> NDArray:
        """κ_k ((2n + 1) π / (2 height))² [1/s], one row for each n < `count`, one column for each κ (ascending)."""
        return self._wave_numbers(count)[:, None] ** 2 * self._modes[0]

    def mode(self, k: int, n: int, x: ArrayLike) -> dict[str, NDArray]:
        """Shape of the mode that decays at `decay_rates()[n, k]`: changes of the `fields` and "displacement" at x [mm]."""
        wave = self._wave_numbers(n + 1)[n]
        vector = self._modes[1][:, k]
        shape = {name: row @ vector * np.cos(wave * np.asarray(x)) for name, row in self.fields.items()}
        return {**shape, "displacement": self.fields["J"] @ vector * np.sin(wave * np.asarray(x)) / wave}

    def top_displacement(
        self, time: ArrayLike, salt: float = 0.0, hydraulic: float = 0.0, step: float | None = None
    ) -> NDArray:
        """Displacement of the top [mm] at times > 0 [s] after the bath's change (`potentials`)."""
        wave = self._wave_numbers(TERMS)
        left = [(2 / (wave * self.height) ** 2) @ decay for decay in self._decays(wave, time, step)]
        return self.height * self._respond(self.fields["J"], np.array(left), salt, hydraulic)

    def profiles(
        self, x: ArrayLike, time: float, salt: float = 0.0, hydraulic: float = 0.0, step: float | None = None
    ) -> dict[str, NDArray]:
        """Changes of the `fields` at the places x [mm] at one time > 0 [s] after the bath's change (`potentials`)."""
        wave = self._wave_numbers(TERMS)
        amplitudes = 2 * (-1.0) ** np.arange(TERMS) / (wave * self.height)
        shapes = np.cos(np.outer(np.asarray(x), wave))
        left = [shapes @ (amplitudes * decay[:, 0]) for decay in self._decays(wave, float(time), step)]
        return {name: self._respond(row, np.array(left), salt, hydraulic) for name, row in self.fields.items()}

    def penalty_shift(self, relative: float, cell: float) -> NDArray:
        """Relative change of the rates (each κ, every n) by `Penalty(relative=...)` on cells of `cell` [mm], to first order.

        Effluxes G (P, Σ) (`penalty_efflux`) in place of prescribed values slow each mode by
        (2/height) vᵀ L G⁻¹ L v / (vᵀ L v).
        """
        efflux = penalty_efflux(self.material, self.bath, relative, cell)
        L, modes = self.conductance, self._modes[1]
        lost = np.einsum("ik,ik->k", modes, L @ np.linalg.solve(efflux, L @ modes))
        return -2 / self.height * lost / np.einsum("ik,ik->k", modes, L @ modes)

    def _wave_numbers(self, count: int) -> NDArray:
        return (2 * np.arange(count) + 1) * pi / (2 * self.height)

    def _decays(self, wave: NDArray, time: ArrayLike, step: float | None) -> list[NDArray]:
        """Of each κ: what is left of each mode (row) at each time (column)."""
        times = np.atleast_1d(np.asarray(time, dtype=float))
        if not (times > 0).all():
            raise InputError(f"time = {times.min():g} s: the series holds after the change of the bath, give times > 0")
        if step is not None:
            checks.positive("step", step)
            count = np.round(times / step)
            if not np.allclose(count * step, times, rtol=1e-9):
                raise InputError(f"time: with step = {step:g} s, give multiples of it")
        found = []
        for kappa in self._modes[0]:
            rates = (kappa * wave**2)[:, None]
            found.append(np.exp(-rates * times) if step is None else np.exp(-np.log1p(rates * step) * count))
        return found

    def _respond(self, row: NDArray, left: NDArray, salt: float, hydraulic: float) -> NDArray:
        """row (w_D − Σ_k v_k left_k v_kᵀ C w_D): the change of one field, `left` from 1 (at the start) to 0."""
        target = potentials(self.material, self.bath, salt, hydraulic)
        modes = self._modes[1]
        return row @ target - (row @ modes * (modes.T @ self.storage @ target)) @ left
