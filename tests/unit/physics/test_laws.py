"""Constitutive laws against their definitions, at a point of general deformation."""

import numpy as np
import pytest
from ngsolve import CF, Det, Inv

from ngswell import TABLE_1, TABLE_2, rectangle
from ngswell.physics import laws
from ngswell.physics.solid import extra_stress, small_strain_moduli

MESH = rectangle(1, 1, 1, 1)  # a mesh point does not keep its mesh alive
POINT = MESH(0.3, 0.4)
DEFORMATION = CF((1.3, 0.2, -0.1, 1.6), dims=(2, 2))


def at(field):
    return np.array(field(POINT))


def printed_stress(F, m):
    """Kirchhoff extra stress as (18) prints it, of a 3 × 3 array."""
    J = np.linalg.det(F)
    volumetric = m.lam * (1 - m.nS0) ** 2 * (J / (1 - m.nS0) - J / (J - m.nS0))
    return m.mu * (F @ F.T - np.eye(3)) + volumetric * np.eye(3)


def test_the_stress_of_the_energy_is_the_printed_one():
    F = np.array([[1.3, 0.2, 0.1], [-0.1, 1.6, 0.0], [0.05, 0.0, 0.9]])
    field = CF(tuple(F.ravel()), dims=(3, 3))
    found = at(extra_stress(field, TABLE_2)).reshape(3, 3) * np.linalg.det(F)
    assert found == pytest.approx(printed_stress(F, TABLE_2), rel=1e-12)  # round-off


def stretched(J):
    return CF((J, 0, 0, 0, 1, 0, 0, 0, 1), dims=(3, 3))


def test_stress_vanishes_in_the_reference_state_and_has_its_pole_at_the_compression_point():
    assert at(extra_stress(stretched(1.0), TABLE_1)) == pytest.approx(np.zeros(9), abs=1e-15)
    # Kirchhoff stress, J times Cauchy's, grows as 1/(J − nS0).
    stiff = [J * abs(at(extra_stress(stretched(J), TABLE_1))[0]) for J in (0.26, 0.2501, 0.250001)]
    assert stiff[1] > 50 * stiff[0]
    assert stiff[2] > 90 * stiff[1]


def test_small_strain_moduli_of_the_papers_law_are_its_parameters():
    assert small_strain_moduli(TABLE_1) == pytest.approx((TABLE_1.mu, TABLE_1.lam), rel=1e-12)


def test_volume_fractions_and_charge():
    J = Det(DEFORMATION)
    nS = at(laws.solidity(J, TABLE_2))
    assert nS == pytest.approx(0.25 / at(J))
    # Charge per reference volume is conserved: J nF cfc = nF0 cfc0.
    assert at(J) * (1 - nS) * at(laws.fixed_charge(J, TABLE_2)) == pytest.approx(0.75 * 0.8, rel=1e-14)


def gradients(c, cfc, RT, bath_gradient=0.0):
    """grad p and grad c of a gel whose charge rises along x, in equilibrium with a bath (or not quite)."""
    grad_cfc = np.array([0.4, -0.1])
    bath = np.sqrt(c * (c - cfc))
    root = c - cfc / 2
    grad_c = (bath * bath_gradient + cfc * grad_cfc / 4) / root + grad_cfc / 2
    grad_p = RT * (2 * grad_c - grad_cfc)  # p − π uniform
    return grad_p, grad_c, grad_cfc


def flows(material, c, cfc, grad_p, grad_c, grad_cfc, nF=0.8):
    J = CF(material.nS0 / (1 - nF))
    return [at(flux) for flux in laws.transport(material, J, CF(c), CF(cfc), *map(tuple_field, (grad_p, grad_c, grad_cfc)))]


def tuple_field(values):
    return CF(tuple(map(float, values)))


def test_nothing_flows_in_donnan_equilibrium_with_varying_charge():
    c, cfc = 0.9, 0.5
    rest = flows(TABLE_2, c, cfc, *gradients(c, cfc, TABLE_2.RT))
    away = flows(TABLE_2, c, cfc, *gradients(c, cfc, TABLE_2.RT, bath_gradient=0.1))
    for still, moving in zip(rest, away, strict=True):
        assert np.abs(still).max() < 1e-12 * np.abs(moving).max()


def test_no_current():
    grad_p, grad_c, grad_cfc = np.array([0.1, 0.3]), np.array([-0.2, 0.5]), np.array([0.3, 0.1])
    _, plus, minus = flows(TABLE_2, 0.9, 0.5, grad_p, grad_c, grad_cfc)
    assert plus == pytest.approx(minus, rel=1e-12)


def test_an_uncharged_gel_obeys_darcy_and_ambipolar_fick():
    grad_p, grad_c = np.array([0.1, 0.3]), np.array([-0.2, 0.5])
    fluid, plus, _ = flows(TABLE_2, 0.9, 0.0, grad_p, grad_c, np.zeros(2))
    D_plus, D_minus = TABLE_2.D_plus, TABLE_2.D_minus
    ambipolar = 2 * D_plus * D_minus / (D_plus + D_minus)  # the textbook diffusivity of a neutral salt
    assert fluid == pytest.approx(-TABLE_2.K * grad_p, rel=1e-12)
    assert plus == pytest.approx(-0.8 * ambipolar * grad_c + 0.9 * fluid, rel=1e-12)


def test_negative_osmosis_drags_fluid_against_leaving_salt():
    # Salt falls along x at uniform p: with D₋ > D₊ the diffusion potential pulls fluid along.
    fluid, plus, _ = flows(TABLE_2, 0.9, 0.5, np.zeros(2), np.array([-1.0, 0.0]), np.zeros(2))
    assert plus[0] > 0
    assert fluid[0] > 0


def test_push_forward_of_fluxes():
    # A law linear in the gradients gives J F⁻¹ w from J F⁻¹ F⁻ᵀ Grad: what the pulled-back balances rely on.
    F = DEFORMATION
    Grad = CF((0.3, -0.7))
    pulled = Det(F) * Inv(F) * (Inv(F).trans * Grad)
    cofactor = Det(F) * Inv(F).trans
    assert at(pulled) == pytest.approx(at(cofactor.trans * cofactor * Grad / Det(F)), rel=1e-13)
