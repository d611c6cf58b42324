"""The state of rest reached directly, against closed forms and against the ramped transient."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import x, y

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Area,
    Bath,
    Concentration,
    DampedNewton,
    Fixed,
    InputError,
    Lagged,
    LocalDonnan,
    Material,
    Penalty,
    Potential,
    Ramp,
    Roller,
    StepError,
    Symmetry,
    Traction,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import P0, quarter, strip


def block(model=None, material=TABLE_2, supports=None, **changes):
    given = {name: value for name, value in (("model", model), ("supports", supports)) if value}
    bath = Ramp((500, 4.1), (600, 0.3))
    return quarter(c=bath, material=material, **{"charge": Ramp((0, 0.0), (400, 1.0)), **given, **changes})


@pytest.mark.parametrize("model", [None, LocalDonnan(), Potential()])
@pytest.mark.parametrize(("time", "bath"), [(500.0, 4.1), (600.0, 0.3)])
def test_homogeneous_block(model, time, bath):
    scene = block(model)
    J = scene.state(scene.equilibrate(time)).J(scene.problem.points).ravel()
    # Newton's tolerance 1e-8 of the unknowns' sizes, and one quadratic step beyond.
    assert pytest.approx(np.full_like(J, homogeneous_equilibrium(TABLE_2, bath, "plane strain").J), rel=1e-9) == J


LAYERED = Material(
    mu=0.12 * (1 + y), lam=0.02, nS0=0.2 + 0.1 * x, cfc0=0.4 + 0.3 * x * y, D_plus=5e-4, D_minus=8e-4, K=1.07e-3
)


@pytest.mark.parametrize("model", [None, Potential()])
@pytest.mark.parametrize("supports", [None, [Roller("bottom", "xy"), Symmetry("left")]])
def test_agrees_with_the_transient(supports, model):
    """Fields of position, free and clamped: the transient ends in the same state, at many times the iterations."""
    scene = block(model, material=LAYERED, supports=supports)
    direct = scene.equilibrate(600.0)
    end = scene.run(1e7, Adaptive(2e-2), newton=DampedNewton()).end
    for name, part in scene.problem.ranges.items():
        size = scene.problem.references[name]
        assert end.values[part] == pytest.approx(direct.values[part], abs=1e-7 * size), name


def test_a_run_stays_in_it():
    scene = block(material=LAYERED, baths=[Bath("top|right", c=1.0)])
    area = Area()
    scene.run(1500.0, Fixed(100.0), [area], resume=scene.equilibrate(1000.0))
    assert area.values == pytest.approx(np.full_like(area.values, area.values[0]), rel=1e-10)


def test_a_loaded_strip_stays_in_its_reference_state():
    scene = strip()
    snapshot = scene.equilibrate()
    u = snapshot.values[scene.problem.ranges["u"]]
    assert np.abs(u).max() < 1e-10
    assert snapshot.values[scene.problem.ranges["p"]] == pytest.approx(P0, rel=1e-9)


def test_refusals():
    with pytest.raises(InputError, match="sealed"):
        block(baths=[], initial=(1.0, 0.0)).equilibrate()
    with pytest.raises(InputError, match="remembers the past"):
        strip(Lagged()).equilibrate()
    # Without charge and λ nothing but µ (1 − nS0²)/nS0 = 0.9 N/mm² resists up to the compression point.
    soft = replace(TABLE_1, cfc0=0.0, lam=0.0)
    with pytest.raises(StepError, match="at 0 of the charge: fluid content J − nS0 would not stay positive"):
        strip(material=soft, loads=[Traction("top", (0.0, -0.91))]).equilibrate()


def test_a_load_that_only_the_charged_body_bears():
    # Without charge the body collapses, which is where continuation in the charge would start. A dead load far above µ
    # makes the free surface of a strip wrinkle: a state of rest, but no stable one.
    material = replace(TABLE_1, lam=0.0)
    for load in (5.0, 900.0):
        scene = strip(material=material, loads=[Traction("top", (0.0, -load))])
        J = scene.state(scene.equilibrate(unstable="off")).J(scene.mesh(0.01, 0.4))
        content = homogeneous_equilibrium(material, 0.15, "confined", load=load).J - material.nS0
        assert J - material.nS0 == pytest.approx(content, rel=1e-8)  # homogeneous: exact to Newton's tolerance


def test_penalty_hardly_matters_at_rest():
    # Nothing flows at rest but what discretisation leaves: ε over ten decades moves the state by an error of order 2. (In
    # potentials the state of rest is exact, whatever ε.)
    differences = []
    for n in (4, 8):
        ends = []
        for relative in (1e-3, 1e7):
            baths = [Bath("top|right", c=1.0, treatment=Penalty(relative=relative))]
            scene = block(Concentration(), LAYERED, mesh=rectangle(1.0, 1.0, n, n), baths=baths)
            ends.append(scene.equilibrate(1000.0).values[scene.problem.ranges["u"]])
        differences.append(np.abs(ends[0] - ends[1]).max())
    assert np.log2(differences[0] / differences[1]) > 1.8
    assert differences[1] < 1e-4
