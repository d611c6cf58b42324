"""Solids beside the paper's: stress from the energy, indifference to rotations, moduli, closed forms."""

from dataclasses import replace
from math import exp, log, sqrt

import numpy as np
import pytest
from ngsolve import CF

from ngswell import (
    TABLE_1,
    TABLE_2,
    Bath,
    HolmesMowSolid,
    InputError,
    LogNeoHookean,
    MooneyRivlin,
    PlaneStrain,
    Pressure,
    Symmetry,
    Traction,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.physics import donnan
from ngswell.physics.solid import Deformation, nominal_stress, small_strain_moduli
from ngswell.scene import Scene
from tests.scenes import confined_column

LAWS = [LogNeoHookean(), MooneyRivlin(0.0), MooneyRivlin(0.4), HolmesMowSolid(0.0), HolmesMowSolid(0.7)]
MESH = rectangle(1, 1, 1, 1)  # a mesh point does not keep its mesh alive
F = np.array([[1.3, 0.2, 0.1], [-0.1, 1.2, 0.0], [0.05, 0.3, 0.9]])


def field(F):
    return CF(tuple(np.asarray(F, float).ravel()), dims=(3, 3))


def gel(law, **changes):
    return replace(TABLE_2, **{"solid": law, "lam": 0.05, **changes})


def block(material, baths, loads):
    supports, mesh = [Symmetry("left"), Symmetry("bottom")], rectangle(1, 1, 1, 1)
    return Scene(mesh=mesh, kinematics=PlaneStrain(), material=material, supports=supports, baths=baths, loads=loads)


def energy(F, material):
    return material.solid.energy(Deformation.of(field(F), material.nS0), material)(MESH(0.3, 0.4))


def nominal(F, material):
    return np.array(nominal_stress(field(F), material)(MESH(0.3, 0.4))).reshape(3, 3)


def of_kirchhoff(stretches, law, m):
    """Principal Kirchhoff stresses as textbooks write them, not from the energy."""
    squares = np.array(stretches) ** 2
    J, I1 = np.prod(stretches), squares.sum()
    I2 = (I1**2 - (squares**2).sum()) / 2
    if law == LogNeoHookean():
        return m.mu * (squares - 1) + m.lam * log(J)
    if isinstance(law, MooneyRivlin):
        C1, C2 = m.mu / 2 * (1 - law.share), m.mu / 2 * law.share
        tau = 2 * (C1 * J ** (-2 / 3) + C2 * J ** (-4 / 3) * I1) * squares - 2 * C2 * J ** (-4 / 3) * squares**2
        return tau - tau.sum() / 3 + (m.lam + 2 / 3 * m.mu) * log(J)
    H = m.lam + 2 * m.mu
    Q = law.beta / H * ((2 * m.mu - m.lam) * (I1 - 3) + m.lam * (I2 - 3) - H * log(J**2))
    return exp(Q) / 2 * ((2 * m.mu - m.lam + m.lam * I1) * squares - m.lam * squares**2 - H)


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_stress_is_that_of_textbooks_uniaxial_biaxial_and_general(law):
    m = gel(law)
    for stretches in [(1.4, 1.0, 1.0), (1.0, 1.0, 0.6), (1.2, 1.2, 0.8), (0.7, 1.5, 1.1)]:
        found = nominal(np.diag(stretches), m) * np.array(stretches)  # τ = P Fᵀ
        assert found == pytest.approx(np.diag(of_kirchhoff(stretches, law, m)), abs=1e-14)  # round-off of 0.1


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_stress_is_the_slope_of_the_energy(law):
    m, step, found = gel(law), 1e-5, nominal(F, gel(law))
    for place in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[place] = step
        slope = (energy(F + change, m) - energy(F - change, m)) / (2 * step)
        assert slope == pytest.approx(found[place], abs=1e-9)  # step² and round-off/step, of stresses of 0.1


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_rotation_turns_the_stress_with_it(law):
    m, (c, s) = gel(law), (0.6, 0.8)
    Q = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    assert energy(Q @ F, m) == pytest.approx(energy(F, m), rel=1e-12)  # round-off
    assert nominal(Q @ F, m) == pytest.approx(Q @ nominal(F, m), abs=1e-14)
    assert nominal(F @ Q, m) == pytest.approx(nominal(F, m) @ Q, abs=1e-14)  # isotropic


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_small_strain_moduli_are_the_materials(law):
    assert small_strain_moduli(gel(law)) == pytest.approx((TABLE_2.mu, 0.05), rel=1e-11)  # round-off of second derivatives


def test_parameters_out_of_range():
    for make, value in [(MooneyRivlin, -0.1), (MooneyRivlin, 1.1), (HolmesMowSolid, -1.0), (HolmesMowSolid, "1")]:
        with pytest.raises(InputError, match=make.__name__):
            make(value)


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("motion", ["confined", "plane strain"])
def test_bodies_come_to_their_closed_form(law, motion):
    material = gel(law)
    if motion == "confined":
        scene = confined_column(None, material=material, cells=2, baths=[Bath("top", c=0.5)], loads=[])
    else:
        scene = block(material, [Bath("top|right", c=0.5)], [])
    found = scene.state(scene.equilibrate()).at((0.2,) * scene.mesh.dim, "J")
    exact = homogeneous_equilibrium(material, 0.5, motion).J
    assert found == pytest.approx(exact, rel=1e-8)  # Newton's tolerance
    assert abs(homogeneous_equilibrium(gel(TABLE_2.solid), 0.5, motion).J - exact) > 1e-3  # control: the paper's law


def test_confined_triphasic_swelling_of_febios_suite():
    """mp01 of FEBio's test suite: E = 0.3, ν = 0, ϕ0 = 0.2, 200 mM of charge, 150 mM of bath, 293 K, R = 8.314."""
    material = replace(
        TABLE_1, mu=0.15, lam=0.0, nS0=0.2, cfc0=0.2, K=9.14e-4, theta=293 * 8.314 / 8.3144, solid=LogNeoHookean()
    )
    scene = confined_column(None, material=material, cells=4, baths=[Bath("top", c=0.15)], loads=[])
    state = scene.state(scene.equilibrate())
    assert state.at((0.25,), "J") == pytest.approx(1.304634, abs=5e-7)  # the digits that are known
    assert state.at((0.25,), "p") == pytest.approx(0.080720, abs=5e-7)
    paper = homogeneous_equilibrium(replace(material, solid=TABLE_1.solid, lam=0.01), 0.15, "confined")
    assert abs(paper.J - 1.304634) > 1e-3  # control: another volumetric part


SALT, STEP = 0.15, 1e-4


@pytest.mark.parametrize("law", [TABLE_1.solid, *LAWS], ids=str)
def test_a_charged_body_has_the_charged_moduli(law):
    """Around the charged state at rest under p0, λ' = λ + Rθ cfc²/(nF sqrt(cfc² + 4 c̄²)) takes the place of λ."""
    m = replace(TABLE_1, solid=law)
    p0 = donnan.pressure(SALT, m.cfc0, m.RT)
    charged = m.lam + m.RT * m.cfc0**2 / ((1 - m.nS0) * sqrt(m.cfc0**2 + 4 * SALT**2))
    confined = 2 * m.mu + charged
    plane = 4 * m.mu * (charged + m.mu) / confined

    def heights(size):
        baths = [Bath("top", c=SALT)]
        column = confined_column(None, material=m, cells=2, baths=baths, loads=[Traction("top", (-p0 + size * confined,))])
        square = block(m, baths, [Pressure("top", p0 - size * plane), Pressure("right", p0)])
        rest = [scene.equilibrate(unstable="off") for scene in (column, square)]
        return np.array([
            column.state(rest[0]).at((0.25,), "J") - 1,
            square.state(rest[1]).at((0.5, 1.0), "displacement")[1],
        ])  # fmt: skip

    strains = (heights(STEP) - heights(-STEP)) / (2 * STEP)
    assert strains == pytest.approx([1.0, 1.0], rel=1e-6)  # terms in STEP² and Newton's 1e-8² remain
    assert charged > 2 * m.lam  # control: λ alone would not do
