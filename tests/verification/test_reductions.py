"""The reduced models against the full one: no charge, fast ions, equilibrium, conservation, permeability."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import CF, x, y

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Bath,
    Blend,
    Concentration,
    Confined,
    DampedNewton,
    Essential,
    Fixed,
    InputError,
    Ledger,
    LocalDonnan,
    Penalty,
    PlaneStrain,
    Potential,
    Probe,
    Ramp,
    Roller,
    Scene,
    Symmetry,
    Traction,
    Uncharged,
    column,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.models.local_donnan import State
from ngswell.physics import donnan, laws
from studies.choices.reductions import effective
from tests.scenes import confined_column

WEAK = Penalty(relative=1e4)
UNCHARGED = replace(TABLE_1, cfc0=0.0)
TIMES = np.array([1.0, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024])  # s


def uncharged_scene(motion, model):
    """A loaded body without charge; the full models have salt that diffuses out on its own."""
    c = None if isinstance(model, Uncharged) else Ramp((0, 0.15), (20, 0.1))
    bath = Bath("top", c=c, P=Ramp((0, 0.0), (20, 0.03)), treatment=WEAK)
    if motion == "column":
        mesh, kinematics, supports = column(0.5, 20), Confined(), [Roller("bottom", "x")]
        loads = [Traction("top", (-0.1,))]
    else:
        mesh, kinematics = rectangle(1.0, 1.0, 3, 3), PlaneStrain()
        supports, loads = [Symmetry("left"), Roller("bottom", "y")], [Traction("top", (0.02, -0.1))]
    return Scene(
        mesh=mesh, kinematics=kinematics, material=UNCHARGED, model=model, supports=supports, baths=[bath], loads=loads
    )


@pytest.mark.parametrize("full", [Concentration, Potential])
@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("motion", ["column", "block"])
def test_uncharged_is_the_full_model_without_charge(motion, order, full):
    # Without charge p and u do not see the salt, in every discrete equation: what differs is Newton's remainder.
    vectors = []
    for model in (Uncharged(order=order), full(order=order)):
        scene = uncharged_scene(motion, model)
        result = scene.run(100.0, Fixed(5.0))
        assert len(result.steps) == 20  # the same steps
        pressure = model.balanced["fluid"]  # p, or P, which is p without charge
        vectors.append([result.end.values[scene.problem.ranges[name]] for name in ("u", pressure)])
    (u, p), (u_full, p_full) = vectors
    assert np.abs(u).max() > 0.02  # mm: finite strain
    # Corrections below 1e-8 of the natural sizes are left out, and one more is applied than was tested.
    assert u == pytest.approx(u_full, abs=1e-10)
    assert p == pytest.approx(p_full, abs=1e-10)


def disturbed_column(model, material, load=0.0, c=0.15, P=0.0, cells=20):
    """A column of Table 1 in equilibrium, disturbed by a load or by its bath's concentration or pressure (on a plate)."""
    baths = [Bath("top", c=c, P=P, treatment=WEAK, porous_plate=True)]
    loads = [Traction("top", (-donnan.pressure(0.15, material.cfc0, material.RT) - load,))]
    return confined_column(cells=cells, material=material, model=model, baths=baths, loads=loads)


def top(scene, newton=None):
    """Displacement of the top at TIMES, which are also the steps: in every model the same."""
    probe = Probe((0.5,), "displacement", when=TIMES)
    scene.run(TIMES[-1], Fixed(TIMES[-1]), [probe], newton)
    return probe.values["displacement"]


DISTURBANCES = {
    "load": {"load": 0.02},
    "hydraulic": {"P": Ramp((0, 0.0), (64, 0.02))},
    "bath": {"c": Ramp((0, 0.15), (64, 0.125))},
}


def distances(disturbance, full_model=Concentration):
    """Largest difference of LocalDonnan to the full model, relative to the largest displacement, for faster and faster ions.

    Only K/D and the clock matter. K is a tenth of Table 1's, so that the largest D stays below what a Material admits;
    order 3, so that the meshes' error does not cover the smallest difference.
    """
    result = []
    for factor in (1, 10, 100):
        D_plus, D_minus = factor * TABLE_1.D_plus, factor * TABLE_1.D_minus
        material = replace(TABLE_1, K=0.1 * TABLE_1.K, D_plus=D_plus, D_minus=D_minus)
        lean, full = (top(disturbed_column(m(order=3), material, **disturbance)) for m in (LocalDonnan, full_model))
        result.append(np.abs(lean - full).max() / np.abs(full).max())
    return np.array(result)


@pytest.mark.parametrize("full", [Concentration, Potential])
@pytest.mark.parametrize("name", DISTURBANCES)
def test_local_donnan_is_the_limit_of_fast_ions(name, full):
    # First order in 1/D once salt diffuses faster (here within 40 to 4 s for D × 10 and × 100) than anything else happens.
    error = distances(DISTURBANCES[name], full)
    order = np.log10(error[:-1] / error[1:])
    assert error[0] < 0.1
    assert order[1] == pytest.approx(1.0, abs=0.06)
    assert order[0] > 0.8


def test_without_drag_a_load_is_answered_far_too_fast(monkeypatch):
    # The limit is the same (the drag goes with 1/D as well), but its error is tens of times larger.
    right = distances(DISTURBANCES["load"])
    monkeypatch.setattr(State, "seepage", lambda state, frame: -state.material.K * (frame * state.drive(state.P)))
    wrong = distances(DISTURBANCES["load"])
    assert (wrong > 20 * right).all()


@pytest.mark.parametrize("load", [1e-6, 1e-2])
def test_small_strains_need_effective_parameters_only(load):
    # Linearised, LocalDonnan is consolidation with an osmotic stiffness and a permeability reduced by the drag.
    # Prescribed values: a weak bath lets the two permeabilities through differently.
    tight = DampedNewton(tolerance=1e-13)
    charged_column = replace(disturbed_column(LocalDonnan(), TABLE_1, load=load), baths=[Bath("top", c=0.15)])
    lean = replace(charged_column, material=effective(TABLE_1, 0.15), model=Uncharged(), baths=[Bath("top")],
                   loads=[Traction("top", (-load,))])  # fmt: skip
    charged, plain, bare = (top(each, tight) for each in (charged_column, lean, replace(lean, material=UNCHARGED)))
    # What is left is of second order: relative to the first, below the strain, load over modulus (0.87 N/mm²), but for
    # round-off of the load: p0 is 1.5e5 times the smaller one.
    assert np.abs(plain - charged).max() / np.abs(charged).max() < load / 0.87 + 1e-9
    # Without them the column is too soft by the osmotic stiffness, 0.37 on top of H = 0.5 N/mm², and not yet at rest.
    assert bare[-1] / charged[-1] > 1.6


@pytest.mark.parametrize("choice", [{}, {"phi": 0.9, "phi_bath": 0.95, "Gamma": 1.1}])
def test_a_uniform_virtual_bath_is_local_donnan(choice):
    """Where c̃ is uniform the two models have one formula for everything: round-off only."""
    material = replace(TABLE_2, **choice)
    states = []
    for model in (LocalDonnan(), Potential()):
        scene = Scene(
            mesh=rectangle(1.0, 1.0, 2, 2), kinematics=PlaneStrain(), material=material, model=model,
            supports=[Symmetry("left"), Symmetry("bottom")], baths=[Bath("top", c=0.3)], charge=Ramp((0, 0.7)),
        )  # fmt: skip
        scene.problem.initialise()
        u, P = scene.problem.fields.components[:2]
        u.Set((0.2 * x + 0.1 * x * y, 0.3 * y - 0.1 * x * x))
        P.Set(0.1 * x - 0.3 * y)
        states.append((scene, scene.problem.state.outputs()))
    (lean, wanted), (full, found) = states
    for place in ((0.2, 0.3), (0.9, 0.6)):
        for name, field in wanted.items():
            expected = np.array(field(lean.mesh(*place)))
            assert np.array(found[name](full.mesh(*place))) == pytest.approx(expected, rel=1e-12, abs=1e-15), name
    assert set(found) - set(wanted) == {"cation_flux"}


def equilibrium(model, bath, kinematics):
    """J, p, c₊, cfc, nS, hydraulic pressure at rest after the bath has moved to `bath`."""
    c = Ramp((0, 4.1), (100, bath))
    if kinematics == "confined":
        shape = {"mesh": column(0.5, 5), "kinematics": Confined(), "supports": [Roller("bottom", "x")]}
        point, wet = (0.25,), "top"
    else:
        supports = [Symmetry("left"), Symmetry("bottom")]
        shape = {"mesh": rectangle(0.5, 0.5, 2, 2), "kinematics": PlaneStrain(), "supports": supports}
        point, wet = (0.25, 0.25), "top|right"
    names = ("J", "p", "c_plus", "c_minus", "cfc", "nS", "fluid_potential")
    probe = Probe(point, *names)
    scene = Scene(
        **shape, material=TABLE_2, model=model, baths=[Bath(wet, c=c, P=0.01, treatment=WEAK)],
        charge=Ramp((0, 0.0), (100, 1.0)),
    )  # fmt: skip
    scene.run(1e6, Adaptive(1e-2), [probe], newton=DampedNewton())
    return {name: float(probe.values[name][-1].item()) for name in names}


@pytest.mark.parametrize("motion", ["confined", "plane strain"])
def test_all_models_come_to_the_same_equilibrium(motion):
    models = (LocalDonnan(), Concentration(), Potential())
    lean, full, other = (equilibrium(model, 0.3, motion) for model in models)
    # A homogeneous state lies in every space: what is left is the relaxation still to come.
    assert lean == pytest.approx(full, rel=1e-7)
    assert lean == pytest.approx(other, rel=1e-7)
    closed = homogeneous_equilibrium(TABLE_2, 0.3, motion, hydraulic=0.01)
    for name, value in (("J", closed.J), ("p", closed.p), ("c_plus", closed.c), ("cfc", closed.cfc), ("nS", closed.nS)):
        assert lean[name] == pytest.approx(value, rel=1e-7)
    assert lean["c_plus"] * lean["c_minus"] == pytest.approx(0.3**2, rel=1e-12)
    assert lean["fluid_potential"] == pytest.approx(0.01 - 2 * TABLE_2.RT * 0.3, rel=1e-7)


@pytest.mark.parametrize("treatment", [Essential(), WEAK])
@pytest.mark.parametrize("motion", ["column", "block"])
@pytest.mark.parametrize("model", [Uncharged(), LocalDonnan()])
def test_ledger_of_the_reduced_models_closes(model, motion, treatment):
    scene = uncharged_scene(motion, Uncharged())
    bath = Bath("top", P=Ramp((0, 0.0), (20, 0.03)), treatment=treatment)
    if isinstance(model, LocalDonnan):
        bath = replace(bath, c=Ramp((0, 0.15), (20, 0.1)))
        scene = replace(scene, material=TABLE_1, model=model, baths=[bath], charge=Ramp((0, 0.0), (20, 1.0)))
    else:
        scene = replace(scene, baths=[bath])
    ledger = Ledger()
    scene.run(200.0, Adaptive(1e-2), [ledger], newton=DampedNewton())
    assert np.abs(ledger.fluid - ledger.fluid[0]).max() > 0.01 * ledger.fluid[0]  # something flows
    assert ledger.imbalance().keys() == {"fluid"}
    # Newton's remainder of 1e-8 per field, with one more correction applied than tested.
    assert ledger.imbalance()["fluid"] < 1e-9


def swollen_point(J, bath=0.15, P_gradient=0.02):
    """A column stretched to J with a linear P [N/mm³ current]: its LocalDonnan state, and a point in it."""
    problem = disturbed_column(LocalDonnan(), TABLE_1, c=bath, cells=4).problem
    problem.initialise()
    problem.fields.components[0].Set((J - 1) * x)
    problem.fields.components[1].Set(P_gradient * J * x)
    return problem, problem.mesh(0.3)


@pytest.mark.parametrize("charge_gradient", [0.0, 3.0])  # mol/l per mm: where salt is uniform, it must not matter
@pytest.mark.parametrize("J", [0.6, 1.0, 2.0])
def test_drag_is_that_of_the_full_model(J, charge_gradient):
    problem, point = swollen_point(J)
    m, state = TABLE_1, problem.state
    cfc = (1 - m.nS0) * m.cfc0 / (J - m.nS0)
    root = (0.15**2 + cfc**2 / 4) ** 0.5
    # With c₊ c₋ = c̄² everywhere: grad c₊ = (½ + cfc/(4 root)) grad cfc, grad p = grad P + 2 Rθ cfc/(4 root) grad cfc.
    grad_c = (0.5 + cfc / (4 * root)) * charge_gradient
    grad_p = 0.02 + 2 * m.RT * cfc / (4 * root) * charge_gradient
    numbers = (J, root + cfc / 2, cfc, grad_p, grad_c, charge_gradient)
    flux = laws.transport(m, *(CF(number) for number in numbers))
    seepage = state.seepage(state.push)(point)
    assert seepage == pytest.approx(flux.fluid(point), rel=1e-12)  # algebra: round-off only
    assert flux.cations(point) == pytest.approx(flux.anions(point), rel=1e-10)  # no current
    # Negative control: Darcy's law alone is faster by the drag.
    conductance = m.D_plus * (root + cfc / 2) + m.D_minus * (root - cfc / 2)
    drag = m.K * m.RT * cfc**2 / ((1 - m.nS0 / J) * conductance)
    assert -m.K * 0.02 / seepage == pytest.approx(1 + drag, rel=1e-12)
    assert drag > 0.05
    assert state.outputs()["seepage"](point) == pytest.approx(seepage, rel=1e-14)


def test_uncharged_refuses_a_charge():
    with pytest.raises(InputError, match=r"0\.2, mol/l.*use Potential, Concentration or LocalDonnan"):
        replace(uncharged_scene("column", Uncharged()), material=TABLE_1)


def test_local_donnan_refuses_more_than_one_bath():
    # A concentration that varies along the boundary is not one bath either: inside, the ions would follow the blend.
    blend = Blend(Ramp((0, 0.15)), Ramp((0, 0.15), (10, 0.1)), x)
    with pytest.raises(InputError, match=r"varies in space.*use Potential or Concentration"):
        disturbed_column(LocalDonnan(), TABLE_1, c=blend)
