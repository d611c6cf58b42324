"""Constitutive choices at a point: reference values, limits, no flow in equilibrium, refusals."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from ngsolve import CF, x

from ngswell import TABLE_2, HolmesMow, InputError, LocalDonnan, MackieMeares, Material, Penalty, PowerLaw, rectangle
from ngswell.physics import donnan, laws
from ngswell.physics.pores import Constant
from tests.scenes import NUMBERS, confined_column

MESH = rectangle(1, 1, 1, 1)  # a mesh point does not keep its mesh alive
POINT = MESH(0.3, 0.4)
ROUND_OFF = 1e-13

PERMEABILITIES = [Constant(), PowerLaw(m=0.0), PowerLaw(m=2.5), HolmesMow(alpha=2.0, M=1.5)]
DIFFUSIVITIES = [Constant(), MackieMeares()]
COEFFICIENTS = [{}, {"phi": 0.8}, {"phi": 1.3, "phi_bath": 0.95, "Gamma": 1.4}]
MATERIALS = [
    replace(TABLE_2, permeability=K, diffusivity=D, **numbers)
    for K, D, numbers in product(PERMEABILITIES, DIFFUSIVITIES, COEFFICIENTS)
]


@pytest.mark.parametrize("law", PERMEABILITIES)
@pytest.mark.parametrize("nS0", [0.05, 0.25, 0.8])
def test_permeability_of_the_reference_state(law, nS0):
    assert law(1.07e-3, 1.0, nS0) == pytest.approx(1.07e-3, rel=ROUND_OFF)


def test_pores_close_at_the_compression_point():
    # K falls as (J − nS0)^m: a tenth of the fluid left, 10^-m of the permeability; the exponential of Holmes and Mow
    # changes by M J ΔJ = 1.5 · 0.25 · 9e-7 on the way.
    far, near = 0.25 + 1e-6, 0.25 + 1e-7
    for law, power in ((PowerLaw(m=2.5), 2.5), (HolmesMow(alpha=2.0, M=1.5), 2.0)):
        assert law(1.0, near, 0.25) < 1e-13
        assert law(1.0, far, 0.25) / law(1.0, near, 0.25) == pytest.approx(10**power, rel=1e-6)
    assert PowerLaw(m=0.0)(2.0, near, 0.25) == 2.0


def test_slopes_and_special_cases_of_the_permeabilities():
    # d ln K/dJ at J = 1 is α/(1 − nS0) + M; central differences of h = 1e-4 are right to h².
    law, h = HolmesMow(alpha=2.0, M=1.5), 1e-4
    slope = (math.log(law(1.0, 1 + h, 0.25)) - math.log(law(1.0, 1 - h, 0.25))) / (2 * h)
    assert slope == pytest.approx(2.0 / 0.75 + 1.5, rel=1e-7)
    assert HolmesMow(alpha=2.0, M=0.0)(1.0, 1.7, 0.25) == pytest.approx(PowerLaw(m=2.0)(1.0, 1.7, 0.25), rel=ROUND_OFF)
    # The void ratio, not the porosity: they differ by J^m.
    porosity = (1 - 0.25 / 1.7) / 0.75
    assert PowerLaw(m=2.0)(1.0, 1.7, 0.25) == pytest.approx((1.7 * porosity) ** 2, rel=ROUND_OFF)


def test_obstruction():
    law = MackieMeares()
    assert law(2.0, 1.0) == 2.0  # free solution
    assert law(1.0, 0.75) == pytest.approx(0.36, rel=ROUND_OFF)
    assert law(1.0, 1e-6) == pytest.approx(0.25e-12, rel=2e-6)  # nF²/4 (1 + nF + ...)


@pytest.mark.parametrize("law", [*PERMEABILITIES, lambda K0, J, nS0: K0 * J])
def test_permeabilities_take_floats_arrays_and_fields(law):
    J = np.array([0.4, 1.0, 2.2])
    floats = [float(law(1.5, value, 0.25)) for value in J]
    assert law(1.5, J, 0.25) * np.ones(3) == pytest.approx(floats, rel=ROUND_OFF)
    field = CF(law(CF(1.5), 0.4 + 1.8 * x, CF(0.25)))
    assert field(MESH(1.0, 0.5)) == pytest.approx(floats[-1], rel=ROUND_OFF)


# -- fluxes ------------------------------------------------------------------------------------------------------------

NF, C, CFC = 0.8, 0.9, 0.5


def flows(material, grad_p, grad_c, grad_cfc):
    fields = (CF(tuple(map(float, g))) for g in (grad_p, grad_c, grad_cfc))
    return [np.array(flux(POINT)) for flux in laws.transport(material, CF(material.nS0 / (1 - NF)), CF(C), CF(CFC), *fields)]


def equilibrium_gradients(material, phi, bath_gradient=0.0):
    """Gradients where c₊ c₋ and p − φ Rθ (c₊ + c₋) are uniform (or not quite)."""
    grad_cfc = np.array([0.4, -0.1])
    root, bath = C - CFC / 2, math.sqrt(C * (C - CFC))
    grad_c = (bath * bath_gradient + CFC * grad_cfc / 4) / root + grad_cfc / 2
    return phi * material.RT * (2 * grad_c - grad_cfc), grad_c, grad_cfc


@pytest.mark.parametrize("material", MATERIALS)
def test_nothing_flows_in_donnan_equilibrium(material):
    rest = flows(material, *equilibrium_gradients(material, material.phi))
    away = flows(material, *equilibrium_gradients(material, material.phi, bath_gradient=0.1))
    wrong = flows(material, *equilibrium_gradients(material, 1.1 * material.phi))
    for still, moving, inconsistent in zip(rest, away, wrong, strict=True):
        assert np.abs(still).max() < 1e-12 * np.abs(moving).max()
        # Another osmotic coefficient in the pressures than in the fluxes: it does flow.
        assert np.abs(inconsistent).max() > 1e-2 * np.abs(moving).max()


@pytest.mark.parametrize("material", MATERIALS)
def test_fluxes_are_those_of_the_electrochemical_potentials(material):
    """Both forms of the docstring agree, with grad E from zero current solved here."""
    grad_p, grad_c, grad_cfc = np.array([0.1, 0.3]), np.array([-0.2, 0.5]), np.array([0.3, 0.1])
    m, RT, c_minus, grad_minus = material, material.RT, C - CFC, grad_c - grad_cfc
    K = float(m.permeability(m.K, m.nS0 / (1 - NF), m.nS0))
    D_plus, D_minus = (float(m.diffusivity(D, NF)) for D in (m.D_plus, m.D_minus))

    def fluxes(E):  # E is grad E / Rθ
        mu_plus, mu_minus = grad_c / C + E, grad_minus / c_minus - E
        fluid = -K * (grad_p - m.phi * RT * (grad_c + grad_minus) + RT * (C * mu_plus + c_minus * mu_minus))
        return fluid, -NF * D_plus * C * mu_plus + C * fluid, -NF * D_minus * c_minus * mu_minus + c_minus * fluid

    def current(E):
        return fluxes(E)[1] - fluxes(E)[2]

    none, one = current(np.zeros(2)), current(np.ones(2))
    E = none / (none - one)  # linear in E, component by component
    for ours, theirs in zip(flows(m, grad_p, grad_c, grad_cfc), fluxes(E), strict=True):
        assert ours == pytest.approx(theirs, rel=1e-12)


def test_factors_enter_where_they_should():
    gradients = np.array([0.1, 0.3]), np.array([-0.2, 0.5]), np.array([0.3, 0.1])
    plain = flows(TABLE_2, *gradients)
    # A law is another K or D: nothing else changes.
    J = 0.25 / (1 - NF)
    powered, by_hand = (
        replace(TABLE_2, permeability=PowerLaw(m=2.0)),
        replace(TABLE_2, K=1.07e-3 * (J - 0.25) ** 2 / 0.75**2),
    )
    obstructed = replace(TABLE_2, diffusivity=MackieMeares())
    factor = (0.8 / 1.2) ** 2
    slower = replace(TABLE_2, D_plus=5e-4 * factor, D_minus=8e-4 * factor)
    for law, number in ((powered, by_hand), (obstructed, slower)):
        for ours, theirs, before in zip(flows(law, *gradients), flows(number, *gradients), plain, strict=True):
            assert ours == pytest.approx(theirs, rel=1e-12)
            assert np.abs(ours - before).max() > 1e-3 * np.abs(before).max()
    # Coefficients of the bath do not enter fluxes.
    outside = flows(replace(TABLE_2, phi_bath=0.9, Gamma=1.3), *gradients)
    assert all((a == b).all() for a, b in zip(outside, plain, strict=True))


@pytest.mark.parametrize("material", MATERIALS)
def test_local_donnan_has_the_same_seepage(material):
    # Uniform stretch 1.2, P falling by 0.3 N/mm² per reference mm: ions in equilibrium, so grad c = grad cfc = 0.
    problem = confined_column(cells=1, material=material, model=LocalDonnan()).problem
    problem.initialise()
    u, P = problem.fields.components
    u.Set(0.2 * x)
    P.Set(-0.3 * x)
    cfc = 0.75 * 0.8 / 0.95
    c = donnan.cations(0.15, cfc, material.Gamma)
    none = CF(0.0)
    full = laws.transport(material, CF(1.2), CF(c), CF(cfc), CF(-0.3 / 1.2), none, none)
    middle = problem.mesh(0.25)
    seepage = problem.state.outputs()["seepage"](middle)
    assert seepage == pytest.approx(full.fluid(POINT), rel=1e-12)
    assert problem.state.outputs()["c_plus"](middle) == pytest.approx(c, rel=1e-12)


# -- equilibrium with a bath -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bath", [1e-4, 0.15, 4.1])
@pytest.mark.parametrize("cfc", [0.0, 0.2, 2.0])
@pytest.mark.parametrize(("Gamma", "phi", "phi_bath"), [(1.0, 1.0, 1.0), (1.4, 0.8, 1.0), (0.6, 1.2, 1.1)])
def test_activities_and_osmotic_pressures(bath, cfc, Gamma, phi, phi_bath):
    plus, minus = donnan.cations(bath, cfc, Gamma), donnan.anions(bath, cfc, Gamma)
    assert plus * minus == pytest.approx((Gamma * bath) ** 2, rel=ROUND_OFF)
    assert plus - minus == pytest.approx(cfc, rel=ROUND_OFF, abs=ROUND_OFF * bath)
    osmotic = 2.5 * (phi * (plus + minus) - phi_bath * 2 * bath)
    # The difference of two large osmotic pressures keeps fewer digits.
    wanted = pytest.approx(0.3 + osmotic, rel=ROUND_OFF, abs=ROUND_OFF * 5 * bath)
    assert donnan.pressure(bath, cfc, 2.5, 0.3, Gamma, phi, phi_bath) == wanted


@pytest.mark.parametrize("model", [{}, {"model": LocalDonnan()}])
def test_constants_cost_nothing(model):
    """No term of an ideal scene has a factor of one, and it is shorter than with a coefficient."""

    def steps(material):
        terms = confined_column(Penalty(40.0), material=material, **model).problem.terms
        return [str(term.integrand.Compile()).splitlines() for term in terms]

    ideal, other = steps(TABLE_2), steps(MATERIALS[-1])
    assert not [line for lines in ideal for line in lines if line.endswith("scale 1")]
    assert sum(map(len, other)) > sum(map(len, ideal))


# -- refusals ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Material(**NUMBERS, phi=0.0), "phi = 0 .*ideal"),
        (lambda: Material(**NUMBERS, phi=-0.9), "phi = -0.9"),
        (lambda: Material(**NUMBERS, phi_bath=93.0), "phi_bath = 93 .*ideal"),
        (lambda: Material(**NUMBERS, Gamma=0.0), "Gamma = 0 .*bath over gel"),
        (lambda: Material(**NUMBERS, Gamma=math.nan), "Gamma = nan"),
        (lambda: Material(**NUMBERS, phi="0.9"), "phi has to be a number"),
        (lambda: Material(**NUMBERS, phi=CF(0.9)), "phi has to be one number"),
        (lambda: Material(**NUMBERS, phi_bath=CF(0.9)), "phi_bath has to be one number"),
        (lambda: Material(**NUMBERS, Gamma=1 + x), "Gamma has to be one number"),
        (lambda: PowerLaw(m=-1.0), "m = -1 .*compaction"),
        (lambda: PowerLaw(m=CF(2.0)), "m has to be a number"),
        (lambda: HolmesMow(alpha=-0.1, M=1.0), "alpha = -0.1"),
        (lambda: HolmesMow(alpha=2.0, M=math.inf), "M = inf"),
        (lambda: Material(**NUMBERS, permeability=2.0), "permeability = 2.0 is not a law.*PowerLaw"),
        (lambda: Material(**NUMBERS, permeability=PowerLaw), "permeability.*not a law.*PowerLaw"),
        (lambda: Material(**NUMBERS, permeability=MackieMeares()), "permeability.*not a law"),
        (lambda: Material(**NUMBERS, permeability=lambda K0, J, nS0: K0 * (J - nS0)), "gives K = 0.5 K0 at J = 1"),
        (lambda: Material(**NUMBERS, diffusivity=PowerLaw(m=2.0)), "diffusivity.*not a law.*MackieMeares"),
        (lambda: Material(**NUMBERS, diffusivity=MackieMeares), "diffusivity.*not a law.*MackieMeares"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
