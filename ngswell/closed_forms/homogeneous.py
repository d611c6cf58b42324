"""Closed forms to compare with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

from ngswell import checks
from ngswell.baths.bath import checked_salt
from ngswell.calls import refusing
from ngswell.errors import InputError
from ngswell.physics import donnan
from ngswell.physics.material import Material
from ngswell.physics.solid import check_alike, homogeneous_response, small_strain_moduli


@refusing
@dataclass(frozen=True)
class Equilibrium:
    """A homogeneous swollen state: J [-], cfc [mol/l], nS [-], c [mol/l], p [N/mm²]."""

    J: float
    cfc: float
    nS: float
    c: float
    p: float


SMALLEST, LARGEST_CONTENT = 1e-12, 1e9
"""Fluid contents between which an equilibrium is looked for: the first in units of nS0."""


@refusing
def parameters(material: Material) -> tuple[float, float]:
    """nS0 [-] and cfc0 [mol/l] as numbers; InputError if they, or parameters of the solid, vary in space."""
    for name in ("mu", "lam"):
        material.number(name)
    return material.number("nS0"), material.number("cfc0")


FREE_DIRECTIONS = {"confined": 1, "plane strain": 2, "3-d": 3}


@refusing
def homogeneous_equilibrium(
    material: Material,
    salt: float,
    motion: str,
    hydraulic: float = 0.0,
    load: float = 0.0,
    boundary_charge: float | None = None,
) -> Equilibrium:
    """The state in which a homogeneous body comes to rest in a bath of `salt` [mol/l] at `hydraulic` [N/mm²].

    `motion` is "confined", "plane strain" or "3-d": d = 1, 2, 3 directions free to stretch by J^(1/d). The extra stress
    balances the pore pressure (38) and what presses on the deformed surface, P̄ and a `load` [N/mm²]:

        dψ/dJ = p_D(c̄, cfc) − P̄ − load,   for the paper's law (18)
        µ (J^(2/d) − 1) + λ (1 − nS0)² [J/(1 − nS0) − J/(J − nS0)] = J (p_D − P̄ − load).

    P̄ adds to p and leaves J; where a porous plate carries it, give load − P̄. p_D has the material's Γ, φ and φ̄.
    `boundary_charge` [mol/l], which does not follow the deformation, replaces cfc(J) in p_D. Raises InputError for what
    varies in space or by direction, and without equilibrium: with φ Γ > φ̄ a weak gel may swell without bound.
    """
    checks.instance("material", material, Material, "a Material(...)")
    checks.choice("motion", motion, FREE_DIRECTIONS)
    salt, free = checked_salt("salt", salt), FREE_DIRECTIONS[motion]
    hydraulic, load = (checks.number(w, v, "N/mm²", -1e3, 1e3) for w, v in (("hydraulic", hydraulic), ("load", load)))
    if boundary_charge is not None:
        boundary_charge = checks.number("boundary_charge", boundary_charge, "mol/l", 0.0, 1e3)
    (nS0, cfc0), response = parameters(material), homogeneous_response(material, free)

    # Everything follows from the fluid content J − nS0, which J itself does not tell near the compression point.
    def charge(content: float) -> float:
        return (1 - nS0) * cfc0 / content

    def osmotic(content: float) -> float:
        cfc, m = charge(content) if boundary_charge is None else boundary_charge, material
        return donnan.pressure(salt, cfc, m.RT, 0.0, m.Gamma, m.phi, m.phi_bath)

    def excess(content: float) -> float:
        return response(content) - osmotic(content) + load

    if excess(SMALLEST * nS0) > 0:
        raise InputError(
            f"no equilibrium: under load = {load:g} N/mm² the body collapses to the compression point, which "
            f"{type(material.solid).__name__} with lam = {material.lam:g} N/mm² does not prevent"
        )
    if (content := _root(excess, SMALLEST * nS0, 1 - nS0)) is None:
        raise InputError(f"no equilibrium: the body swells without bound in a bath of {salt:g} mol/l")
    J, cfc = nS0 + content, charge(content)
    check_alike(material, free, J)
    c = donnan.cations(salt, cfc if boundary_charge is None else boundary_charge, material.Gamma)
    return Equilibrium(J, cfc, nS0 / J, c, hydraulic + osmotic(content))


def _root(function: Callable[[float], float], low: float, high: float) -> float | None:
    """Where a function turns positive above `low`, to round-off; None if nowhere. Bisection over decades, then numbers."""
    while function(high) < 0:
        high *= 2
        if high > LARGEST_CONTENT:
            return None
    while low < (middle := sqrt(low * high) if high > 2 * low else (low + high) / 2) < high:
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return high


@refusing
def lagged_column_factor(material: Material, salt: float) -> float:
    """Factor by which one step of the lagged boundary multiplies a perturbation of a confined column's end [-].

    At the stress-free reference state the end's J follows its pore pressure at once, (2µ + λ) δJ = δp, and the pressure
    follows the charge of the step before: δp = (dp_D/dcfc) (dcfc/dJ) δJ_old. The factor is their product over 2µ + λ,
    whatever the time step; the column is stable while it stays above −1.
    """
    nS0, cfc0 = parameters(material)
    mu, lam = small_strain_moduli(material)
    slope = 2 * material.phi * material.RT * (cfc0 / 4) / ((material.Gamma * salt) ** 2 + cfc0 * cfc0 / 4) ** 0.5
    return slope * (-cfc0 / (1 - nS0)) / (2 * mu + lam)
