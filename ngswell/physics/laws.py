"""Pore fluid, charge and ions: functions of the state, one equation each, of NGSolve fields (trial functions or results).

J is the volume ratio, c the cation concentration and cfc the fixed charge per fluid volume. Fluxes are linear in the
gradients they are given, so they come out in the frame the gradients are in.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from ngsolve import CF, CoefficientFunction, Norm

from ngswell.checks import Field
from ngswell.physics import donnan
from ngswell.physics.anisotropy import ratios
from ngswell.physics.material import Material


def solidity(J: CoefficientFunction, material: Material) -> CoefficientFunction:
    """nS = nS0 / J, eq. (13)₁ [-]."""
    return material.nS0 / J


def porosity(J: CoefficientFunction, material: Material) -> CoefficientFunction:
    """nF = 1 − nS, eq. (1) [-]."""
    return 1 - solidity(J, material)


def fluid_content(J: CoefficientFunction, material: Material) -> CoefficientFunction:
    """Fluid volume per reference volume J nF = J − nS0 [-]; zero at the compression point."""
    return J - material.nS0


def fixed_charge(J: CoefficientFunction, material: Material, charge: Field = 1.0) -> CoefficientFunction:
    """cfc = (1 − nS0) cfc0 / (J − nS0), eq. (13)₂ [mol/l]; `charge` scales cfc0."""
    return charge * (1 - material.nS0) * material.cfc0 / fluid_content(J, material)


def permeability(J: CoefficientFunction, material: Material) -> Field:
    """K(J) by the material's law [mm⁴/(N s)]."""
    return material.permeability(material.K, J, material.nS0)


def diffusivities(nF: CoefficientFunction, material: Material) -> tuple[Field, Field]:
    """D₊ and D₋ by the material's law [mm²/s]."""
    D_plus, D_minus = material.diffusivities
    return material.diffusivity(D_plus, nF), material.diffusivity(D_minus, nF)


class Transport(NamedTuple):
    """Fluxes relative to the solid: nF wF [mm/s], nF c₊ w₊ and nF c₋ w₋ [mol/l mm/s]."""

    fluid: CoefficientFunction
    cations: CoefficientFunction
    anions: CoefficientFunction


def transport_by_potentials(
    material: Material,
    J: CoefficientFunction,
    salt: CoefficientFunction,
    cfc: CoefficientFunction,
    drive: CoefficientFunction,
    grad_salt: CoefficientFunction,
) -> Transport:
    """The same fluxes, (19) to (22), from the gradients of the virtual bath (P, c̃) in equilibrium with the point.

    `salt` is c̃, `drive` is grad P (less the fluid's weight). With the electrochemical potentials over Rθ, grad µ₊ + grad µ₋
    = 2 grad ln c̃, and zero current for grad µ₊,

        nF wF     = −K [grad P − 2 φ̄ Rθ grad c̃ + Rθ (cfc grad µ₊ + 2 c₋ grad ln c̃)]
        nF c₊ w₊  = −nF D₊ c₊ grad µ₊ + c₊ nF wF
        grad µ₊   = {2 (D₋ − D_L) c₋ grad ln c̃ − D_L/Rθ [grad P − 2 φ̄ Rθ grad c̃]} / Θ.

    c₋ grad ln c̃ = (Γ²c̃/c₊) grad c̃ has no pole at c̃ = 0. Θ, D_L as in `transport`.
    """
    m, RT = material, material.RT
    plus, minus = donnan.cations(salt, cfc, m.Gamma), donnan.anions(salt, cfc, m.Gamma)
    nF, K, D_plus, D_minus, D_L, conductance = _mobilities(m, J, plus, minus, cfc)
    of_fluid = drive - 2 * m.phi_bath * RT * grad_salt
    of_anions = (m.Gamma**2 * salt / plus) * grad_salt  # c₋ grad ln c̃
    of_cations = (2 * (D_minus - D_L) * of_anions - D_L / RT * of_fluid) / conductance  # grad µ₊
    fluid = -K * (of_fluid + RT * (cfc * of_cations + 2 * of_anions))
    cations = -nF * D_plus * plus * of_cations + plus * fluid
    anions = -nF * D_minus * (2 * of_anions - minus * of_cations) + minus * fluid
    return Transport(fluid, cations, anions)


def transport(
    material: Material,
    J: CoefficientFunction,
    c: CoefficientFunction,
    cfc: CoefficientFunction,
    drive: CoefficientFunction,
    grad_c: CoefficientFunction,
    grad_cfc: CoefficientFunction,
) -> Transport:
    """Extended Darcy and Fick laws with the electric potential eliminated by zero current, eqs. (19) to (22).

    `drive` is grad p (less the fluid's weight where a scene has one). With electrochemical potentials µ± over Rθ, grad µ± =
    grad ln c± ± grad E/Rθ (activity coefficients constant in the gel), and the osmotic coefficient φ,

        nF wF     = −K [drive − φ Rθ grad (c₊ + c₋) + Rθ (c₊ grad µ₊ + c₋ grad µ₋)] = −K (drive' + cfc grad E)
        drive'    = drive + (1 − φ) Rθ grad (c₊ + c₋)
        nF c± w±  = −nF D± c± grad µ± + c± nF wF = −nF D± (grad c± ± c± grad E / Rθ) + c± nF wF
        grad E    = −Rθ/Θ [D_L/Rθ drive' − (D₋ − D₊) grad c + D₋ grad cfc],
        Θ = D₊ c + D₋ (c − cfc) + D_L cfc,   D_L = cfc K Rθ / nF

    With φ = 1, the paper's, the overall pressure drives: with the factor printed in (19) a gel in Donnan equilibrium with
    non-uniform charge would not come to rest. (20) is taken with the porosity that D_L in (22) needs; ion saturations
    are zero. K and D± are those of the material's laws.
    """
    RT = material.RT
    nF, K, D_plus, D_minus, D_L, conductance = _mobilities(material, J, c, c - cfc, cfc)
    if material.phi != 1:
        drive = drive + (1 - material.phi) * RT * (2 * grad_c - grad_cfc)
    field = -1 / conductance * (D_L / RT * drive - (D_minus - D_plus) * grad_c + D_minus * grad_cfc)  # grad E / Rθ
    fluid = -K * (drive + RT * cfc * field)
    plus = -nF * D_plus * (grad_c + c * field) + c * fluid
    minus = -nF * D_minus * (grad_c - grad_cfc - (c - cfc) * field) + (c - cfc) * fluid
    return Transport(fluid, plus, minus)


def own_conductances(
    material: Material, J: CoefficientFunction, c: CoefficientFunction, cfc: CoefficientFunction
) -> tuple[CoefficientFunction, CoefficientFunction]:
    """How much fluid a gradient of p drives [mm⁴/(N s)], and how many cations one of c [mm²/s], by `transport`:

        fluid    L = K (1 − D_L cfc/Θ),
        cations  nF D₊ + |D₋ − D₊| c (nF D₊ + Rθ K cfc)/Θ + 2 |1 − φ| Rθ c L.

    The moduli stand for D₋ − D₊ and 1 − φ (times at most c L): the fluxes of unlike signs do not make a penalty negative.
    Where the permeability depends on direction, K is the largest.
    """
    if largest := max(ratios(material.permeability), default=0.0):
        material = replace(material, K=max(largest, 1.0) * material.K)
    nF, K, D_plus, D_minus, D_L, conductance = _mobilities(material, J, c, c - cfc, cfc)
    fluid = K * (1 - D_L * cfc / conductance)
    cations = nF * D_plus + Norm(CF(D_minus - D_plus)) * c * nF * (D_plus + D_L) / conductance
    if material.phi != 1:
        cations = cations + 2 * abs(1 - material.phi) * material.RT * c * fluid
    return fluid, cations


class _Mobilities(NamedTuple):
    """What fluxes are made of: nF, K, D₊ and D₋ by the material's laws, D_L and Θ as in `transport`."""

    nF: CoefficientFunction
    K: Field
    D_plus: Field
    D_minus: Field
    D_L: CoefficientFunction
    conductance: CoefficientFunction


def _mobilities(
    material: Material,
    J: CoefficientFunction,
    cations: CoefficientFunction,
    anions: CoefficientFunction,
    cfc: CoefficientFunction,
) -> _Mobilities:
    nF, K = porosity(J, material), permeability(J, material)
    D_plus, D_minus = diffusivities(nF, material)
    D_L = cfc * K * material.RT / nF
    return _Mobilities(nF, K, D_plus, D_minus, D_L, D_plus * cations + D_minus * anions + D_L * cfc)
