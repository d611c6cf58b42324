"""Baths of finite volume: the state they end in, the way there, and what gel and bath hold together."""

from dataclasses import replace
from math import pi, tan

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    Adaptive,
    Area,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    Cylindrical,
    DampedNewton,
    Fixed,
    Ledger,
    Material,
    Multiplier,
    Nitsche,
    Penalty,
    PlaneStrain,
    Potential,
    Problem,
    Ramp,
    Roller,
    Scene,
    Spatial,
    Spherical,
    Traction,
    TwoLevelSolver,
    Vessel,
    box,
    column,
    rectangle,
)
from ngswell.analysis.perturbations import Perturbations
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.physics import donnan
from tests.scenes import P0


def root(function, low, high):
    """By halving."""
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) * function(low) > 0 else (low, middle)
    return middle


HEIGHT, BEFORE = 0.5, 0.15  # mm; mol/l, the bath that the gel was in
TREATMENTS = [
    (Potential(), None),
    (Potential(3), Penalty(1.0)),
    (Concentration(), None),
    (Concentration(), Multiplier()),
    (Concentration(3), Nitsche()),
    (Concentration(), Nitsche(5.0, "skew")),
]


def gel(vessel, c=0.05, model=None, treatment=None, cells=8, **changes):
    """A confined column out of `BEFORE` into a vessel with `c`."""
    pieces = {
        "mesh": column(HEIGHT, cells),
        "kinematics": Confined(),
        "material": TABLE_1,
        "model": model or Potential(),
        "supports": [Roller("bottom", "x")],
        "baths": [Bath("top", c=c, treatment=treatment, vessel=vessel)],
        "initial": (BEFORE, 0.0),
        "loads": [Traction("top", (-P0,))],  # under which the charged gel is at rest in `BEFORE`
    }
    return Scene(**(pieces | changes))


FED = Vessel(0.3, inflow=Ramp((0, 0.0), (100, 1e-4)), outflow=2e-4, c_in=0.2)


@pytest.mark.parametrize("steps", [Fixed(20.0), Adaptive(1e-3)])
@pytest.mark.parametrize(("model", "treatment"), TREATMENTS)
def test_gel_and_bath_close_to_round_off(model, treatment, steps):
    # Sums over the same test functions, in both balances: what is left is Newton's last quadratic remainder.
    ledger = Ledger()
    gel(FED, model=model, treatment=treatment).run(200.0, steps, [ledger], newton=DampedNewton())
    assert max(ledger.imbalance().values()) < 1e-11
    together = ledger.cations + ledger.bath_cations["top"] - ledger.cations_fed["top"]
    assert np.abs(together - together[0]).max() < 1e-11
    assert np.ptp(ledger.bath_c["top"]) > 0.02
    assert abs(ledger.fluid_fed["top"][-1]) > 0.01  # much has passed
    assert ledger.fluid_fed["top"][-1] == pytest.approx(-0.025 if steps != Fixed(20.0) else -0.024, rel=1e-9)  # Euler: late


def end_of_column(volume, c):
    """J and bath [mol/l] of a confined column at rest with what a vessel of `volume` [mm] with `c` and it hold together.

    The body began at J = 1 in equilibrium with `BEFORE`. Cations of the gel: H (J − nS0) c₊; of the bath: V c̄ with
    V = V₀ − H (J − 1).
    """
    nS0 = TABLE_1.number("nS0")
    held = volume * c + HEIGHT * (1 - nS0) * donnan.cations(BEFORE, TABLE_1.number("cfc0"))

    def lack(salt):
        rest = homogeneous_equilibrium(TABLE_1, salt, "confined", load=P0)
        return (volume - HEIGHT * (rest.J - 1)) * salt + HEIGHT * (rest.J - nS0) * rest.c - held

    salt = root(lack, 1e-6, 1.0)
    return homogeneous_equilibrium(TABLE_1, salt, "confined", load=P0).J, salt


@pytest.mark.parametrize(("volume", "c"), [(0.4, 0.05), (5.0, 0.3)])
@pytest.mark.parametrize("model", [Potential(), Concentration()])
def test_a_column_in_a_beaker_ends_where_what_both_hold_is_conserved(model, volume, c):
    # Rest is homogeneous, so no error of mesh; after 1e7 s, 1e4 times the slowest decay, Newton's tolerance is left.
    ledger = Ledger()
    result = gel(Vessel(volume), c, model, cells=3).run(1e7, Adaptive(1e-3), [ledger], newton=DampedNewton())
    J, salt = end_of_column(volume, c)
    assert result.state.at((0.2,), "J") == pytest.approx(J, rel=1e-8)
    assert ledger.bath_c["top"][-1] == pytest.approx(salt, rel=1e-8)
    assert abs(salt - c) > 1e-3  # control: an infinite bath ends elsewhere
    assert abs(homogeneous_equilibrium(TABLE_1, c, "confined", load=P0).J - J) > 1e-3


@pytest.mark.parametrize(("model", "treatment"), TREATMENTS)
def test_the_state_of_rest_in_a_beaker_is_found_at_once(model, treatment):
    ledger = Ledger()
    scene = gel(Vessel(0.2), 1e-3, model, treatment, cells=2)
    J, salt = end_of_column(0.2, 1e-3)
    assert scene.state(scene.equilibrate(observers=[ledger])).at((0.2,), "J") == pytest.approx(J, rel=1e-10)  # round-off
    assert ledger.bath_c["top"][-1] == pytest.approx(salt, rel=1e-10)
    assert ledger.bath_fluid["top"][-1] == pytest.approx(0.2 - HEIGHT * (J - 1), rel=1e-10)


@pytest.mark.parametrize("vessel", [None, Vessel(1.0)])
@pytest.mark.parametrize(("cells", "relative"), [(6, 1e4), (12, 1e4), (30, 1e2)])
def test_much_saltier_water_is_taken_by_coarse_even_cells(cells, relative, vessel):
    # From 0.024 to 0.39 mol/l at once: salt is lumped on the way, which moves what the fields are, but not what they hold.
    ledger = Ledger()
    scene = gel(
        vessel, 0.39, Potential(), Penalty(relative=relative), cells, material=UNCHARGED, initial=(0.0237, 0.0), loads=[]
    )
    result = scene.run(1e4, Adaptive(1e-3), [ledger])
    held = HEIGHT * 0.75
    end = 0.39 if vessel is None else (0.39 + held * 0.0237) / (1 + held)
    assert result.state.at((0.1,), "c_plus") == pytest.approx(end, rel=3e-3)  # of the steps
    assert max(ledger.imbalance().values()) < 1e-5  # of their solves


MOTIONS = [
    (PlaneStrain(), rectangle(0.5, 0.4, 2, 2), [Roller("bottom", "y"), Roller("left", "x")], "top|right", 0.3, 0.2),
    (Axisymmetric(), rectangle(0.5, 0.4, 2, 2), [Roller("bottom", "z"), Roller("left", "r")], "top|right", 0.5, 0.1 * pi),
    (Spatial(), box(0.5, 0.5, 0.4, 1, 1, 2), [
        Roller("bottom", "z"), Roller("left", "x"), Roller("front", "y")], "top|right|back", 0.2, 0.1),
]  # fmt: skip


@pytest.mark.parametrize(("motion", "mesh", "supports", "boundary", "volume", "body"), MOTIONS)
def test_a_free_body_in_a_beaker_conserves_its_fluid_and_salt(motion, mesh, supports, boundary, volume, body):
    # Volumes of the beaker are those of the ledger: mm² in the plane, whole turns about an axis. Round-off of the sums.
    ledger = Ledger()
    scene = Scene(
        mesh=mesh, kinematics=motion, material=TABLE_1, supports=supports,
        baths=[Bath(boundary, c=0.5, vessel=Vessel(volume))], charge=Ramp((0, 0.0), (2000, 1.0)),
    )  # fmt: skip
    scene.run(1000.0, Fixed(500.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-11
    assert ledger.fluid[0] == pytest.approx(0.75 * body, rel=1e-12)
    assert ledger.bath_fluid[boundary][0] == pytest.approx(volume, rel=1e-12)
    scene.run(1e7, Adaptive(1e-1), [ending := Ledger()], newton=DampedNewton(), unstable="off")
    scene.equilibrate(1e7, observers=[rested := Ledger()], unstable="off")
    assert rested.bath_c[boundary][-1] == pytest.approx(ending.bath_c[boundary][-1], rel=1e-6)  # of solves to 1e-8
    swollen = ledger.fluid[-1] - ledger.fluid[0]
    assert swollen > 1e-2 * body
    assert ledger.bath_fluid[boundary][-1] == pytest.approx(volume - swollen, rel=1e-11)


@pytest.mark.parametrize(("motion", "volume", "body"), [(Spherical(), 3.0, 4 * pi / 3), (Cylindrical(), 3.0, pi)])
def test_a_bead_in_a_beaker_comes_to_rest_as_its_closed_form(motion, volume, body):
    # Volumes of the beaker are those of the whole bead, and per length of a cylinder. Homogeneous: Newton's tolerance.
    ledger = Ledger()
    scene = Scene(
        mesh=column(1.0, 3), kinematics=motion, material=TABLE_1, supports=[Roller("bottom", "r")],
        baths=[Bath("top", c=0.3, vessel=Vessel(volume))], initial=(BEFORE, 0.0),
    )  # fmt: skip
    scene.equilibrate(observers=[ledger])
    free = "3-d" if motion == Spherical() else "plane strain"
    rest = homogeneous_equilibrium(TABLE_1, ledger.bath_c["top"][-1], free)
    assert ledger.fluid[-1] == pytest.approx(body * (rest.J - 0.25), rel=1e-8)
    assert ledger.bath_fluid["top"][-1] == pytest.approx(volume - body * (rest.J - 1), rel=1e-8)
    held = volume * 0.3 + body * 0.75 * donnan.cations(BEFORE, TABLE_1.number("cfc0"))
    assert ledger.cations[-1] + ledger.bath_cations["top"][-1] == pytest.approx(held, rel=1e-10)


def test_wrinkles_grow_in_a_beaker_as_in_an_infinite_bath():
    # They take as much fluid here as they give there, so that the vessel sees nothing of them: to inverse iteration's 1e-8.
    def rate(vessel):
        scene = Scene(
            mesh=rectangle(0.4, 0.5, 4, 5), kinematics=PlaneStrain(), material=replace(TABLE_1, mu=0.1),
            supports=[Roller("bottom", "y"), Roller("left|right", "x")], loads=[Traction("top", (0.0, -P0))],
            baths=[Bath("top", c=BEFORE, treatment=Penalty(relative=1e4), vessel=vessel)],
        )  # fmt: skip
        problem = Problem(scene)
        problem.initialise()
        return Perturbations(problem).fastest(1e-6).rate

    infinite = rate(None)
    assert infinite > 1e-2
    assert [rate(Vessel(volume)) for volume in (1.0, 1e-3)] == pytest.approx([infinite] * 2, rel=1e-8)


def test_the_two_level_solver_takes_a_beaker():
    # The number belongs to no vertex: it stands on the coarse level. Within ten times Newton's tolerance of 1e-8.
    motion, mesh, supports, boundary, volume, _ = MOTIONS[-1]
    ends = []
    for options in ({}, {"solver": TwoLevelSolver}):
        ledger = Ledger()
        scene = Scene(
            mesh=mesh, kinematics=motion, material=TABLE_1, supports=supports,
            baths=[Bath(boundary, c=0.5, vessel=Vessel(volume))], charge=Ramp((0, 0.0), (2000, 1.0)),
        )  # fmt: skip
        scene.run(500.0, Fixed(500.0), [ledger], **options)
        ends.append([ledger.bath_fluid[boundary][-1], ledger.bath_c[boundary][-1]])
    assert ends[0] == pytest.approx(ends[1], rel=1e-7)


UNCHARGED = Material(mu=1.0, lam=1.0, nS0=0.25, cfc0=0.0, D_plus=5e-4, D_minus=5e-4, K=1e-3)


def uptake(alpha, T):
    """Share of the final uptake of a sheet from a stirred bath, Crank, The Mathematics of Diffusion, (4.37).

    1 − Σ 2α(1 + α)/(1 + α + α² q²) exp(−q² T), tan q = −α q, T = D t/l²; α the bath's volume over the sheet's fluid.
    """
    roots = [root(lambda q: tan(q) + alpha * q, (n - 0.5) * pi + 1e-9, n * pi) for n in range(1, 60)]
    return 1 - sum(2 * alpha * (1 + alpha) / (1 + alpha + (alpha * q) ** 2) * np.exp(-(q**2) * T) for q in roots)


def test_salt_that_diffuses_into_a_sheet_from_a_beaker_follows_its_series():
    # Without charge nothing moves but salt, so the series is the model's own solution. Tolerance of the steps 1e-5; a graded
    # mesh of third order leaves less (measured 3e-6).
    volume, times = 0.2, [50.0, 200.0, 800.0]
    ledger, scene = Ledger(), gel(
        Vessel(volume), 0.3, Potential(3), material=UNCHARGED, mesh=column(HEIGHT, 24, grade={"top": 20}),
        initial=(0.1, 0.0), loads=[],
    )  # fmt: skip
    scene.run(times[-1], Adaptive(1e-5), [ledger, Area(when=times)])
    alpha = volume / (HEIGHT * 0.75)
    final = volume * (0.3 - 0.1) / (1 + alpha)  # what the gel has taken up in the end
    landed = [int(np.flatnonzero(ledger.time == time)[0]) for time in times]
    taken = (ledger.bath_cations["top"][0] - ledger.bath_cations["top"][landed]) / final
    T = np.array(times) * 5e-4 / HEIGHT**2
    assert taken == pytest.approx([uptake(alpha, t) for t in T], abs=1e-5)
    assert abs(taken[0] - uptake(1e3, T[0])) > 0.05  # control: a large bath gives it more slowly
