"""Closed forms to compare with."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from ngswell import checks
from ngswell.baths.bath import checked_salt
from ngswell.errors import InputError
from ngswell.physics import donnan
from ngswell.physics.material import Material


@dataclass(frozen=True)
class Equilibrium:
    """A homogeneous swollen state: J [-], cfc [mol/l], nS [-], c [mol/l], p [N/mm²]."""

    J: float
    cfc: float
    nS: float
    c: float
    p: float


FREE_DIRECTIONS = {"confined": 1, "plane strain": 2, "3-d": 3}


def homogeneous_equilibrium(
    material: Material,
    bath: float,
    motion: str,
    hydraulic: float = 0.0,
    load: float = 0.0,
    boundary_charge: float | None = None,
) -> Equilibrium:
    """The state in which a homogeneous body comes to rest in a bath of `bath` [mol/l] at `hydraulic` [N/mm²].

    `motion` is "confined", "plane strain" or "3-d": d = 1, 2, 3 directions free to stretch by J^(1/d). Equilibrium of the
    extra stress (18) with the pore pressure (38) and an outer pressure `load` [N/mm²] on the deformed surface:

        µ (J^(2/d) − 1) + λ (1 − nS0)² [J/(1 − nS0) − J/(J − nS0)] = J (p_D(c̄, cfc) − load).

    p_D has the material's Γ, φ and φ̄; with φ Γ > φ̄ a weak gel may swell without bound. `boundary_charge` [mol/l]
    replaces cfc(J) in p_D: a boundary condition that does not follow the deformation.
    Raises InputError for parameters that vary in space and where there is no equilibrium.
    """
    checks.instance("material", material, Material, "a Material(...)")
    checks.one_of("motion", motion, FREE_DIRECTIONS)
    bath = checked_salt("bath", bath)
    hydraulic = checks.number("hydraulic", hydraulic, "N/mm²", -1e3, 1e3)
    load = checks.number("load", load, "N/mm²", -1e3, 1e3)
    if boundary_charge is not None:
        boundary_charge = checks.number("boundary_charge", boundary_charge, "mol/l", 0.0, 1e3)
    mu, lam, nS0, cfc0 = (material.number(name) for name in ("mu", "lam", "nS0", "cfc0"))

    # Everything follows from the fluid content J − nS0, which J itself does not tell near the compression point.
    def charge(content: float) -> float:
        return (1 - nS0) * cfc0 / content

    def pressure(content: float) -> float:
        cfc, m = charge(content) if boundary_charge is None else boundary_charge, material
        return donnan.pressure(bath, cfc, m.RT, hydraulic, m.Gamma, m.phi, m.phi_bath)

    def excess(content: float) -> float:
        J = nS0 + content
        extra = mu * (J ** (2 / FREE_DIRECTIONS[motion]) - 1) + lam * (1 - nS0) * J * (J - 1) / content
        return extra - J * (pressure(content) - load)

    low, high = 1e-12 * nS0, 1 - nS0
    if excess(low) > 0:
        raise InputError(
            f"no equilibrium: under load = {load:g} N/mm² the body collapses to the compression point, which "
            f"lam = {lam:g} N/mm² does not prevent"
        )
    while excess(high) < 0:
        high *= 2
        if high > 1e9:
            raise InputError(f"no equilibrium: the body swells without bound in a bath of {bath:g} mol/l")
    while low < (middle := sqrt(low * high) if high > 2 * low else (low + high) / 2) < high:
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)
    J = nS0 + high
    c = donnan.cations(bath, charge(high) if boundary_charge is None else boundary_charge, material.Gamma)
    return Equilibrium(J, charge(high), nS0 / J, c, pressure(high))


def lagged_column_factor(material: Material, bath: float) -> float:
    """Factor by which one step of the lagged boundary multiplies a perturbation of a confined column's end [-].

    At the stress-free reference state the end's J follows its pore pressure at once, (2µ + λ) δJ = δp, and the pressure
    follows the charge of the step before: δp = (dp_D/dcfc) (dcfc/dJ) δJ_old. The factor is their product over 2µ + λ,
    whatever the time step; the column is stable while it stays above −1.
    """
    mu, lam, nS0, cfc0 = (material.number(name) for name in ("mu", "lam", "nS0", "cfc0"))
    slope = 2 * material.phi * material.RT * (cfc0 / 4) / ((material.Gamma * bath) ** 2 + cfc0 * cfc0 / 4) ** 0.5
    return slope * (-cfc0 / (1 - nS0)) / (2 * mu + lam)
