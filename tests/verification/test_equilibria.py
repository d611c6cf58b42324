"""Equilibria against closed forms; nothing moves in them."""

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Area,
    Bath,
    Concentration,
    Confined,
    DampedNewton,
    Fixed,
    Frozen,
    Lagged,
    Ledger,
    Penalty,
    Pin,
    PlaneStrain,
    Probe,
    Ramp,
    Roller,
    Scene,
    Symmetry,
    Traction,
    Weight,
    column,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import P0, confined_column, strip


@pytest.mark.parametrize(
    ("bath", "J", "cfc", "nS", "p"),
    [(4.1, 1.41133, 0.5166, 0.1771, 0.040287), (0.3, 3.05420, 0.2140, 0.0819, 0.091698)],
)
def test_closed_form_of_table_2(bath, J, cfc, nS, p):
    # The values of the theory's table, to the digits printed there.
    state = homogeneous_equilibrium(TABLE_2, bath, "plane strain")
    assert pytest.approx(J, abs=6e-6) == state.J
    assert state.cfc == pytest.approx(cfc, abs=6e-5)
    assert state.nS == pytest.approx(nS, abs=6e-5)
    assert state.p == pytest.approx(p, abs=6e-7)


@pytest.mark.parametrize("motion", ["confined", "plane strain", "3-d"])
@pytest.mark.parametrize("bath", [1e-6, 0.15, 5.0])
def test_closed_form_balances_the_stress(motion, bath):
    state = homogeneous_equilibrium(TABLE_2, bath, motion)
    d = {"confined": 1, "plane strain": 2, "3-d": 3}[motion]
    extra = 0.12 * (state.J ** (2 / d) - 1) + 0.02 * 0.75**2 * (state.J / 0.75 - state.J / (state.J - 0.25))
    assert extra == pytest.approx(state.J * state.p, rel=1e-12)
    assert state.c * (state.c - state.cfc) == pytest.approx(bath**2, rel=1e-9)
    assert state.nS * state.J == pytest.approx(0.25, rel=1e-14)
    # Less constraint, more swelling.
    assert homogeneous_equilibrium(TABLE_2, bath, "3-d").J >= state.J


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("treatment", [Penalty(40.0), Penalty(relative=1e3)])
def test_free_block_comes_to_the_closed_form(treatment, order):
    scene = Scene(
        mesh=rectangle(1.0, 0.8, 2, 2),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        model=Concentration(order=order),
        supports=[Symmetry("right"), Pin((0.0, 0.0), "y")],
        baths=[Bath("top|left|bottom", c=Ramp((0, 4.1), (100, 0.3)), treatment=treatment)],
        charge=Ramp((0, 0.0), (100, 1.0)),
    )
    area, probe = Area(), Probe((0.5, 0.4), "J", "p", "cfc", "c_plus", "nS")
    scene.run(1e6, Adaptive(1e-2), [area, probe], newton=DampedNewton())
    state = homogeneous_equilibrium(TABLE_2, 0.3, "plane strain")
    # A homogeneous state lies in every space: what is left is the relaxation still to come.
    assert area.values[-1] / 0.8 == pytest.approx(state.J, rel=1e-8)
    for name, value in (("J", state.J), ("p", state.p), ("cfc", state.cfc), ("c_plus", state.c), ("nS", state.nS)):
        assert probe.values[name][-1] == pytest.approx(value, rel=1e-7)


def test_hydraulic_pressure_of_the_bath_only_shifts_the_pressure():
    # P̄ in the bath presses on the surface: incompressible constituents do not notice.
    def top(P):
        probe = Probe((0.5,), "J", "p")
        baths = [Bath("top", c=Ramp((0, 0.15), (10, 0.125)), P=P)]
        confined_column(baths=baths, loads=[Traction("top", (-P0,))]).run(50.0, Fixed(5.0), [probe])
        return probe.values

    calm, pressed = top(0.0), top(0.7)
    assert pressed["J"] == pytest.approx(calm["J"], rel=1e-9)
    assert pressed["p"] == pytest.approx(calm["p"] + 0.7, rel=1e-9)


@pytest.mark.parametrize("treatment", [Penalty(1.0), Frozen()])
def test_strip_in_equilibrium_stays(treatment):
    probe = Probe((0.0, 0.5), "displacement")
    strip(treatment).run(1000.0, Fixed(50.0), [probe])
    assert np.abs(probe.values["displacement"]).max() < 1e-13  # round-off on 0.5 mm


def test_column_and_strip_agree():
    c = Ramp((0, 0.15), (10, 0.125))
    ends = []
    for make, point in ((confined_column, (0.5,)), (strip, (0.0, 0.5))):
        probe = Probe(point, "displacement")
        make(c=c).run(200.0, Fixed(10.0), [probe])
        ends.append(probe.values["displacement"].reshape(len(probe.time), -1)[:, -1])
    assert ends[0] == pytest.approx(ends[1], abs=1e-10)  # the same discretisation, to Newton's tolerance


def test_weight_of_the_fluid_is_hydrostatic():
    # γF sixty times the real one on a column: at rest the hydraulic pressure falls by γF per current length and the
    # support carries the weight of what is there.
    gamma_F, gamma_S = 6e-4, 1.5e-3
    scene = Scene(
        mesh=column(20.0, 40),
        kinematics=Confined(),
        material=TABLE_1,
        supports=[Roller("bottom", "x")],
        baths=[Bath("top", c=0.15, treatment=Penalty(relative=1e4))],
        loads=[Weight((-gamma_F,), (-gamma_S,))],
    )
    ledger = Ledger()
    low, high = (Probe((z,), "fluid_potential", "displacement", "c_plus", "c_minus", "stress", "J") for z in (0.0, 20.0))
    scene.run(2e7, Adaptive(1e-5), [ledger, low, high], newton=DampedNewton())
    length = 20.0 + high.values["displacement"][-1] - low.values["displacement"][-1]
    fall = low.values["fluid_potential"][-1] - high.values["fluid_potential"][-1]
    assert fall == pytest.approx(gamma_F * length, rel=2e-5)  # h² of linear p on 40 cells
    weight = gamma_S * 20 * 0.25 + gamma_F * ledger.fluid[-1]
    stress, J = low.values["stress"][-1].reshape(3, 3), low.values["J"].ravel()[-1]
    assert stress[0, 0] == pytest.approx(-weight, rel=2e-2)  # elementwise stress at the end cell
    # What the walls bear beside it: nothing but µ (B − I)/J tells the directions apart.
    sideways = stress[0, 0] - TABLE_1.mu * (J - 1 / J)
    assert stress == pytest.approx(np.diag([stress[0, 0], sideways, sideways]), rel=1e-12, abs=1e-14)
    assert abs(J - 1) > 1e-3
    assert low.values["c_plus"][-1] * low.values["c_minus"][-1] == pytest.approx(0.15**2, rel=1e-4)
    # Round-off of p times the penalty and a last step of some 1e7 s.
    assert max(ledger.imbalance().values()) < 1e-7


def test_closed_forms_of_fig_4():
    following = homogeneous_equilibrium(TABLE_1, 0.125, "confined", load=P0)
    frozen = homogeneous_equilibrium(TABLE_1, 0.125, "confined", load=P0, boundary_charge=0.2)
    assert pytest.approx(0.01341, abs=5e-6) == 0.5 * (following.J - 1)
    assert pytest.approx(0.02439, abs=5e-6) == 0.5 * (frozen.J - 1)


def test_lagged_column_is_stable_but_slower_to_settle():
    probe = Probe((0.5,), "displacement")
    confined_column(Lagged(), c=Ramp((0, 0.15), (10, 0.125))).run(6000.0, Fixed(20.0), [probe])
    closed = 0.5 * (homogeneous_equilibrium(TABLE_1, 0.125, "confined", load=P0).J - 1)
    assert probe.values["displacement"][-1] == pytest.approx(closed, rel=1e-6)
