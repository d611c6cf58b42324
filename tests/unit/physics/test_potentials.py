"""The flux laws in the variables of a virtual bath against those in p and c, on smooth fields of position."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import CF, cos, exp, sin, x, y

from ngswell import TABLE_2, HolmesMow, MackieMeares, PowerLaw, rectangle
from ngswell.physics import donnan, laws

MESH = rectangle(1.0, 1.0, 1, 1)  # a mesh point does not keep its mesh alive
POINTS = [MESH(*place) for place in np.random.default_rng(0).uniform(size=(20, 2))]
REAL = {"phi": 0.85, "phi_bath": 0.95, "Gamma": 1.1}
CHOICES = {
    "ideal": {},
    "phi": {"phi": 0.85},
    "phi_bath": {"phi_bath": 1.2},
    "Gamma": {"Gamma": 1.3},
    "power law": {"permeability": PowerLaw(2.0)},
    "Mackie-Meares": {"diffusivity": MackieMeares()},
    "all": {**REAL, "permeability": HolmesMow(2.0, 1.0), "diffusivity": MackieMeares()},
    "fields": {**REAL, "K": 1e-3 * (1 + x), "D_plus": 5e-4 * (1 + y), "nS0": 0.2 + 0.1 * x},
}


def gradient(f):
    return CF((f.Diff(x), f.Diff(y)))


def at(field):
    return np.array([field(point) for point in POINTS])


def virtual_bath(dilution=1.0):
    """Smooth c̃ [mol/l], P [N/mm²], cfc [mol/l] and nF; no function of another."""
    return (
        dilution * exp(sin(2 * x) + cos(3 * y)),
        0.3 * sin(x + 2 * y) + 0.1 * x,
        0.4 + 0.3 * sin(3 * x) * cos(y),
        0.7 + 0.2 * cos(x - y),
    )


def transport_arguments(material, dilution=1.0, weight=(0.0, 0.0)):
    """J, c, cfc and the gradients of p, c and cfc that the virtual bath amounts to, eqs. (23) and (38)."""
    bath, P, cfc, nF = virtual_bath(dilution)
    m = material
    p = donnan.pressure(bath, cfc, m.RT, P, m.Gamma, m.phi, m.phi_bath)
    c = donnan.cations(bath, cfc, m.Gamma)
    return m.nS0 / (1 - nF), c, cfc, gradient(p) - CF(weight), gradient(c), gradient(cfc)


def both_forms(material, dilution=1.0, weight=(0.0, 0.0)):
    """Fluxes by p and c and by P and c̃, the fluid's `weight` [N/mm³] taken from either drive."""
    bath, P, cfc, nF = virtual_bath(dilution)
    plain = laws.transport(material, *transport_arguments(material, dilution, weight))
    J = material.nS0 / (1 - nF)
    return plain, laws.transport_by_potentials(material, J, bath, cfc, gradient(P) - CF(weight), gradient(bath))


def roundoff(material, dilution):
    """What floating point leaves of fluid and ion fluxes, which are differences of flows of the size K |grad P| (c₊ times
    that): a streaming potential may hold back all but a hundredth. Forty units in the last place."""
    _, P, cfc, nF = virtual_bath(dilution)
    drive = laws.permeability(material.nS0 / (1 - nF), material) * gradient(P)
    flow = np.abs(at(drive)).max()
    return {"fluid": 40 * 2.2e-16 * flow} | dict.fromkeys(("cations", "anions"), 40 * 2.2e-16 * flow * at(cfc).max())


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("dilution", [1.0, 1e-2])
@pytest.mark.parametrize("weight", [(0.0, 0.0), (0.1, -0.4)])
def test_the_two_forms_of_the_fluxes_agree(choice, dilution, weight):
    material = replace(TABLE_2, **CHOICES[choice])
    plain, by_potentials = both_forms(material, dilution, weight)
    for name, left in roundoff(material, dilution).items():
        expected, found = at(getattr(plain, name)), at(getattr(by_potentials, name))
        assert np.abs(found - expected).max() < left + 1e-13 * np.abs(expected).max(), name


@pytest.mark.parametrize("name", ["phi", "phi_bath", "Gamma", "permeability", "diffusivity"])
def test_every_choice_acts(name):
    # Control: with a choice in one of the two forms only, they differ.
    choice = {"phi": 0.95, "phi_bath": 0.95, "Gamma": 1.05, "permeability": PowerLaw(0.5), "diffusivity": MackieMeares()}
    plain, _ = both_forms(replace(TABLE_2, **{name: choice[name]}))
    _, by_potentials = both_forms(TABLE_2)
    expected, found = at(plain.cations), at(by_potentials.cations)
    if name == "phi":  # the one in the equation of state only: p contains it, and with P and c̃ no flux does
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
        plain = laws.transport(TABLE_2, *transport_arguments(replace(TABLE_2, phi=choice[name])))
        expected = at(plain.cations)
    assert np.abs(found - expected).max() > 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("dilution", [1.0, 1e-4, 1e-12])
def test_no_current(choice, dilution):
    material = replace(TABLE_2, **CHOICES[choice])
    _, flux = both_forms(material, dilution)
    plus, minus = at(flux.cations), at(flux.anions)
    assert np.abs(plus - minus).max() < roundoff(material, dilution)["cations"] + 1e-13 * np.abs(plus).max()


def test_fluxes_have_a_limit_in_pure_water():
    """Down to c̃ = 0: no pole. With c₋ = 0 only cations carry current, so they stay: no salt flux, and the fluid drags its
    charge through their conductance, nF wF = −K grad P / (1 + K Rθ cfc/(nF D₊))."""
    _, P, cfc, nF = virtual_bath()
    m = TABLE_2
    drag = m.K * m.RT * cfc / (nF * m.D_plus)
    limit = at(-m.K / (1 + drag) * gradient(P))
    deviations = []
    for dilution in (1e-3, 1e-6, 1e-12, 0.0):
        _, flux = both_forms(m, dilution)
        values = at(flux.fluid)
        assert np.isfinite(values).all()
        assert np.isfinite(at(flux.cations)).all()
        deviations.append(np.abs(values - limit).max() / np.abs(limit).max())
    # The bath enters with 2 Rθ grad c̃, of the order of c̃ [mol/l]; then round-off.
    assert deviations[0] / deviations[1] == pytest.approx(1e3, rel=0.1)
    assert max(deviations[2:]) < 1e-10
    assert np.abs(at(flux.cations)).max() < 1e-12 * np.abs(at(cfc * flux.fluid)).max()


def test_nothing_flows_where_the_bath_is_one():
    bath, P, cfc, nF = CF(0.3), CF(0.1), *virtual_bath()[2:]
    flux = laws.transport_by_potentials(TABLE_2, TABLE_2.nS0 / (1 - nF), bath, cfc, gradient(P), gradient(bath))
    for field in flux:
        assert np.abs(at(field)).max() == 0.0
