"""Scenes with constitutive choices beside the paper's: equilibria, steady flows, growth of the lagged map."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import Integrate, Norm, x, y

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Area,
    Bath,
    Concentration,
    DampedNewton,
    HolmesMow,
    Lagged,
    Ledger,
    LocalDonnan,
    MackieMeares,
    Material,
    Penalty,
    Pin,
    PlaneStrain,
    Potential,
    PowerLaw,
    Probe,
    Ramp,
    Scene,
    Symmetry,
    Traction,
    Uncharged,
    column,
    rectangle,
)
from ngswell.analysis.one_step import growth_factor
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium, lagged_column_factor
from ngswell.physics import donnan, laws
from tests.scenes import confined_column, quarter

REAL = {"phi": 0.85, "phi_bath": 0.95, "Gamma": 1.1}
CHOICES = [
    {**REAL, "permeability": PowerLaw(m=2.0), "diffusivity": MackieMeares()},
    {"phi": 1.1, "phi_bath": 1.05, "Gamma": 0.9, "permeability": HolmesMow(alpha=2.0, M=1.0)},
]
MODELS = [Concentration(), Potential(), LocalDonnan()]


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("model", MODELS)
def test_column_comes_to_the_closed_form(model, choice):
    material = replace(TABLE_2, **choice)
    probe = Probe((0.2,), "J", "p", "cfc", "c_plus", "c_minus", "fluid_potential")
    baths = [Bath("top", c=Ramp((0, 1.0), (100, 0.3)), P=0.05)]
    scene = confined_column(material=material, model=model, baths=baths, cells=6, loads=[Traction("top", (-0.1,))])
    scene.run(1e6, Adaptive(2e-2), [probe], newton=DampedNewton())
    state = homogeneous_equilibrium(material, 0.3, "confined", hydraulic=0.05, load=0.1)
    osmotic = material.RT * material.phi_bath * 2 * 0.3
    wanted = {"J": state.J, "p": state.p, "cfc": state.cfc, "c_plus": state.c, "c_minus": state.c - state.cfc}
    wanted["fluid_potential"] = 0.05 - osmotic
    for name, value in wanted.items():
        # A homogeneous state lies in every space: what is left is the relaxation still to come.
        assert probe.values[name][-1] == pytest.approx(value, rel=1e-8)
    # The coefficients matter: without them the column ends elsewhere.
    assert abs(homogeneous_equilibrium(TABLE_2, 0.3, "confined", hydraulic=0.05, load=0.1).J / state.J - 1) > 1e-2


@pytest.mark.parametrize("model", MODELS)
def test_free_block_comes_to_the_closed_form(model):
    material = replace(TABLE_2, **CHOICES[0])
    scene = Scene(
        mesh=rectangle(1.0, 0.8, 2, 2),
        kinematics=PlaneStrain(),
        material=material,
        model=model,
        supports=[Symmetry("right"), Pin((0.0, 0.0), "y")],
        baths=[Bath("top|left|bottom", c=Ramp((0, 1.0), (100, 0.3)))],
        charge=Ramp((0, 0.0), (100, 1.0)),
    )
    area = Area()
    scene.run(1e6, Adaptive(2e-2), [area], newton=DampedNewton())
    assert area.values[-1] / 0.8 == pytest.approx(homogeneous_equilibrium(material, 0.3, "plane strain").J, rel=1e-8)


# -- charge that varies ------------------------------------------------------------------------------------------------


def at_rest(n, choice, model):
    """A free block whose charge and stiffness vary, brought to rest in 1 mol/l."""
    material = Material(
        mu=0.12 * (1 + y), lam=0.02, nS0=0.2 + 0.1 * x, cfc0=0.3 + 0.3 * x * y, D_plus=5e-4, D_minus=8e-4, K=1e-3, **choice
    )
    scene = quarter(c=1.0, cells=n, material=material, model=model, charge=Ramp((0, 0.0), (100, 1.0)), initial=(1.0, 0.0))
    return scene.run(1e7, Adaptive(5e-2), newton=DampedNewton())


def errors(result, choice):
    """Root mean squares of c₊ c₋ − (Γ c̄)², of the seepage and of the uneven part of the hydraulic pressure."""
    out, mesh = result.state.outputs(), result.setup.mesh
    salt = out["c_plus"] * out["c_minus"] - choice["Gamma"] ** 2
    uneven = out["fluid_potential"] + 2 * result.setup.material.RT * choice["phi_bath"]
    return np.array([Integrate(e * e, mesh, order=8) ** 0.5 for e in (salt, Norm(out["seepage"]), uneven)])


@pytest.mark.parametrize("choice", CHOICES)
def test_varying_charge_comes_to_donnan_equilibrium_exactly(choice):
    """With the virtual bath as unknown, uniform P and c̃ lie in every space: rest is exact on any mesh."""
    assert errors(at_rest(2, choice, Potential()), choice).max() < 1e-9  # Newton's 1e-8 and one more correction; relaxation


@pytest.mark.parametrize("choice", CHOICES)
def test_varying_charge_comes_to_donnan_equilibrium(choice):
    """c₊ c₋ = (Γ c̄)², P = P̄ everywhere and no seepage, to discretisation error: order 2 for fields, 1 for the flux."""
    coarse, fine = (errors(at_rest(n, choice, Concentration()), choice) for n in (4, 8))
    assert fine.max() < 1e-5  # the negative control below leaves 2e-3 N/mm²
    rates = np.log2(coarse / fine)
    assert rates[0] > 1.7
    assert rates[1] > 0.8
    assert rates[2] > 1.7


def test_an_osmotic_coefficient_in_the_bath_condition_alone_spoils_it(monkeypatch):
    # Negative control: fluxes with φ = 1 under a Donnan condition with φ = 0.85. The gel does not come to equilibrium: its
    # fluid circulates, and P keeps differences of some (1 − φ) of the osmotic ones.
    choice, consistent = CHOICES[0], laws.transport
    good = errors(at_rest(4, choice, Concentration()), choice)
    monkeypatch.setattr(laws, "transport", lambda material, *fields: consistent(replace(material, phi=1.0), *fields))
    bad = errors(at_rest(4, choice, Concentration()), choice)
    assert bad[2] > 100 * good[2]
    assert bad[1] > 2 * good[1]


def test_all_models_reach_the_same_equilibrium():
    """A confined column of varying charge swells point by point as the closed form of its local charge says."""
    material = replace(TABLE_2, **CHOICES[0])
    nodes, weights = np.polynomial.legendre.leggauss(12)  # to round-off for an analytic integrand
    local = [homogeneous_equilibrium(replace(material, cfc0=0.6 + 0.2 * node), 0.3, "confined").J for node in nodes]
    exact = weights @ local / 2 - 1

    def error(model, cells):
        probe = Probe((1.0,), "displacement")
        baths, charged = [Bath("top", c=0.3)], replace(material, cfc0=0.4 + 0.4 * x)
        scene = confined_column(mesh=column(1.0, cells), material=charged, model=model, baths=baths, loads=[])
        scene.run(1e7, Adaptive(5e-2), [probe], newton=DampedNewton())
        return abs(probe.values["displacement"][-1] - exact)

    # Linear p, c, cfc: order 2. The others have the charge at the point, and the end of a 1-d column superconverges.
    full, finer = error(Concentration(), 8), error(Concentration(), 16)
    assert finer < 1e-4 * exact
    assert np.log2(full / finer) > 1.8
    for model in (LocalDonnan(), Potential()):
        assert error(model, 16) < 1e-8 * exact


# -- flows -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [PowerLaw(m=2.0), HolmesMow(alpha=2.0, M=3.0)])
def test_steady_seepage_through_a_column_of_varying_permeability(law):
    """W L = −∫ K(J)/J dp, with J(p) from the stress of the confined column under zero load."""
    material = replace(TABLE_1, cfc0=0.0, permeability=law)

    def J_at(p):
        return homogeneous_equilibrium(material, 1.0, "confined", load=-p).J

    nodes, weights = np.polynomial.legendre.leggauss(30)
    pressures = 0.15 * (1 + nodes)
    exact = sum(w * 0.15 * law(material.K, J_at(p), 0.25) / J_at(p) for w, p in zip(weights, pressures, strict=True)) / 0.5

    def seepage(cells):
        ledger = Ledger()
        scene = confined_column(
            cells=cells,
            material=material,
            model=Uncharged(),
            baths=[Bath("bottom", P=0.3), Bath("top", P=0.0)],
            loads=[],
            initial=(None, 0.0),
        )
        scene.run(1e6, Adaptive(5e-2), [ledger], newton=DampedNewton())
        return np.diff(ledger.fluid_left["top"])[-1] / np.diff(ledger.time)[-1]

    coarse, fine = (abs(seepage(cells) / exact - 1) for cells in (10, 20))
    assert fine < 1e-4
    assert np.log2(coarse / fine) > 1.8  # linear p; the conserved flux does better


def test_steady_diffusion_through_a_compressed_column():
    """Salt between two baths crosses an uncharged column at nF D [nF/(2 − nF)]² Δc̄ / (J L), D the neutral salt's."""
    material = replace(TABLE_1, cfc0=0.0, diffusivity=MackieMeares())
    probe = Probe((0.25,), "cation_flux", "J")
    firm = Penalty(relative=1e8)
    scene = confined_column(
        cells=8,
        material=material,
        baths=[Bath("bottom", c=0.3, treatment=firm), Bath("top", c=0.1, treatment=firm)],
        loads=[Traction("top", (-0.1,))],
        initial=(0.2, 0.0),
    )
    scene.run(1e7, Adaptive(5e-2), [probe], newton=DampedNewton())
    J = homogeneous_equilibrium(material, 0.2, "confined", load=0.1).J
    nF = 1 - 0.25 / J
    D = 2 * 5e-4 * 8e-4 / (5e-4 + 8e-4) * (nF / (2 - nF)) ** 2
    assert J < 0.9
    assert probe.values["J"][-1] == pytest.approx(J, rel=1e-10)
    # Linear c is exact; the penalties let c slip by 1e-8 of its difference over a cell at either end.
    assert probe.values["cation_flux"].ravel()[-1] == pytest.approx(nF * D * 0.2 / (0.5 * J), rel=1e-7)


def test_growth_of_the_lagged_column():
    # φ scales the slope of p_D, Γ c̄ stands for c̄; both make a visible difference. A soft column, so that it dominates.
    material = replace(TABLE_1, mu=0.06, **CHOICES[0])
    load = donnan.pressure(0.15, 0.2, material.RT, 0.0, material.Gamma, material.phi, material.phi_bath)
    scene = confined_column(Lagged(), material=material, loads=[Traction("top", (-load,))])
    factor = lagged_column_factor(material, 0.15)
    assert factor < -1
    assert growth_factor(scene, 1.0).factor == pytest.approx(factor, rel=1e-5)  # the eigenvalue iteration's tolerance
    assert abs(lagged_column_factor(replace(material, phi=1.0, Gamma=1.0), 0.15) / factor - 1) > 0.1
