"""Vessels: what they refuse, what they say, and runs that go on with them."""

import numpy as np
import pytest
from ngsolve import x

from ngswell import (
    TABLE_1,
    Adaptive,
    Area,
    Bath,
    Blend,
    Checkpoint,
    Concentration,
    Efflux,
    Essential,
    Fixed,
    InputError,
    Lagged,
    Ledger,
    LocalDonnan,
    PlaneStrain,
    Potential,
    Ramp,
    Roller,
    Scene,
    Sine,
    StepError,
    Traction,
    Vessel,
    read_checkpoint,
    rectangle,
)
from tests.scenes import P0, confined_column

BEAKER = Vessel(0.3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Vessel(0.0), "volume"),
        (lambda: Vessel(-1.0), "volume"),
        (lambda: Vessel(1e20), "volume"),
        (lambda: Vessel(float("nan")), "volume"),
        (lambda: Vessel(1.0, outflow=-1.0), "outflow"),
        (lambda: Vessel(1.0, inflow=1.0), "c_in"),
        (lambda: Vessel(1.0, inflow=1.0, c_in=-0.1), "c_in"),
        (lambda: Vessel(1.0, inflow=Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), x), c_in=0.1), "stirred"),
        (lambda: Bath("top", c=0.1, vessel=2.0), "Vessel"),
        (lambda: Bath("top", c=Ramp((0, 0.1), (1, 0.2)), vessel=BEAKER), "unknown"),
        (lambda: Bath("top", c=0.1, P=Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), x), vessel=BEAKER), "stirred"),
    ],
)
def test_what_cannot_be_a_vessel_is_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize(
    ("model", "treatment", "words"),
    [
        (Potential(), Essential(), "take Penalty"),
        (Concentration(), Lagged(), "take Penalty, Nitsche, Multiplier"),
        (LocalDonnan(), None, "LocalDonnan does not balance salt"),
    ],
)
def test_models_and_treatments_that_cannot_follow_a_bath_are_refused(model, treatment, words):
    with pytest.raises(InputError, match=words):
        confined_column(model=model, baths=[Bath("top", c=0.15, treatment=treatment, vessel=BEAKER)])


def square(*baths):
    return Scene(
        mesh=rectangle(1.0, 1.0, 2, 2),
        kinematics=PlaneStrain(),
        material=TABLE_1,
        supports=[Roller("bottom", "y"), Roller("left", "x")],
        baths=list(baths),
    )


def test_a_vessel_that_touches_another_bath_is_refused():
    with pytest.raises(InputError, match=r"Bath\('top\|right'"):
        square(Bath("top", c=0.15, vessel=BEAKER), Bath("right", c=0.15))


def test_baths_apart_may_be_in_vessels():
    ledger = Ledger()
    baths = [Bath("top", c=0.15, vessel=BEAKER), Bath("bottom", c=0.15, vessel=Vessel(1.0, outflow=1e-4))]
    scene = Scene(
        mesh=rectangle(1.0, 1.0, 2, 2), kinematics=PlaneStrain(), material=TABLE_1, baths=baths,
        supports=[Roller("bottom", "y"), Roller("left|right", "x")], loads=[Traction("top", (0.0, -P0))],
    )  # fmt: skip
    scene.run(100.0, Fixed(50.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-11  # round-off
    assert ledger.fluid_fed["bottom"][-1] == pytest.approx(-1e-2)
    assert ledger.fluid_fed["top"][-1] == 0.0


def test_describe_names_the_unknowns_and_the_vessel():
    text = square(Bath("top|right", c=0.15, vessel=Vessel(0.3, outflow=1e-5))).describe()
    assert "salt of the bath on top|right 1" in text
    assert "in a vessel of 0.3 mm², stirred, with in- and outflow" in text
    assert "volume of the bath on top|right: content on top|right, in- and outflow on top|right" in text


def test_a_bath_that_runs_dry_stops_the_run():
    scene = confined_column(baths=[Bath("top", c=0.15, vessel=Vessel(0.01, outflow=1e-3))], model=Potential(), cells=4)
    with pytest.raises(StepError, match="volume of the bath on top"):
        scene.run(100.0, Fixed(1.0))
    with pytest.raises(InputError, match="more is let out"):  # than gel and bath hold: seen before the first step
        scene.run(1000.0, Fixed(1.0))


@pytest.mark.parametrize(
    ("vessel", "exact"),
    [
        (Vessel(1.0, inflow=Ramp((0, 0.0), (30, 6.0)), outflow=1.0, c_in=0.1), 90.0 + 6 * 70 - 100),
        (Vessel(1.0, outflow=Sine(1.0, 1.0, 10.0, 4)), -100.0),
    ],
)
def test_what_a_history_lets_in(vessel, exact):
    # Trapezia are exact for ramps, and for a sine over whole periods.
    assert vessel.let_in(0.0, 100.0) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(
    ("baths", "loads"),
    [
        ([Bath("top", c=0.15, vessel=Vessel(1.0, outflow=1e-9))], []),
        ([Bath("top", c=0.15, vessel=BEAKER), Bath("bottom", c=0.15)], []),
        ([Bath("top", c=0.15, vessel=BEAKER)], [Efflux("bottom", fluid=1e-6)]),
    ],
)
def test_equilibrate_refuses_what_the_past_decides(baths, loads):
    with pytest.raises(InputError, match="run until it rests"):
        confined_column(baths=baths, loads=loads, model=Potential()).equilibrate()


def test_the_next_part_puts_the_body_into_a_vessel_and_out_of_it():
    # Swollen in a large bath, moved into a beaker, on in the same beaker, then into a new one.
    swollen = confined_column(None, model=Potential(), cells=4)
    rest = swollen.equilibrate()
    ledgers = [Ledger() for _ in range(3)]
    beaker = Bath("top", c=0.05, vessel=BEAKER)
    first = swollen.after(rest, start=0.0, baths=[beaker])
    there = first.run(100.0, Fixed(20.0), ledgers[:1])
    second = first.after(there)
    again = second.run(200.0, Fixed(20.0), ledgers[1:2])
    second.after(again, baths=[beaker]).run(300.0, Fixed(20.0), ledgers[2:])
    c = [ledger.bath_c["top"] for ledger in ledgers]
    assert c[0][0] == pytest.approx(0.05, rel=1e-14)
    assert c[2][0] == c[0][0]
    assert c[0][-1] == c[1][0]
    assert c[0][-1] < c[1][-1]
    held = ledgers[1].cations + ledgers[1].bath_cations["top"]
    assert np.ptp(held) < 1e-12  # round-off
    assert ledgers[2].cations[0] == ledgers[1].cations[-1]
    out = second.after(again, baths=[Bath("top", c=0.15)])
    assert out.equilibrate().values == pytest.approx(rest.values, abs=1e-9)  # Newton's tolerance


def test_a_snapshot_without_the_vessel_is_refused_by_a_run():
    scene = confined_column(model=Potential(), cells=4, baths=[Bath("top", c=0.15, vessel=BEAKER)])
    with pytest.raises(InputError, match="another numbers"):
        scene.run(10.0, resume=confined_column(baths=[Bath("top", c=0.15)], model=Potential(), cells=4).equilibrate())


@pytest.mark.parametrize("steps", [Fixed(10.0), Adaptive(1e-3)])
def test_a_run_goes_on_from_its_checkpoint_with_the_bath(steps, tmp_path):
    def run(until, **options):
        ledger, bath = Ledger(), Bath("top", c=0.05, vessel=Vessel(0.3, inflow=1e-4, outflow=2e-4, c_in=0.3))
        scene = confined_column(model=Potential(), cells=4, baths=[bath], initial=(0.15, 0.0))
        scene.run(until, steps, [ledger, Area(when=[50.0])], **options)
        return ledger

    path = tmp_path / "beaker.checkpoint"
    whole = run(100.0)
    run(50.0, checkpoint=Checkpoint(path))
    ledger = run(100.0, resume=read_checkpoint(path))
    if steps == Fixed(10.0):  # control of errors looks ahead to the end of the run
        assert ledger.bath_c["top"] == pytest.approx(whole.bath_c["top"], rel=1e-14)
        assert ledger.cations_fed["top"] == pytest.approx(whole.cations_fed["top"], rel=1e-14)
    assert ledger.cations_fed["top"][0] == 0.0  # the records of the earlier part go on
    assert max(ledger.imbalance().values()) < 1e-5  # of the steps' tolerance; Fixed: round-off


TIMES = [0.5, 5.0, 50.0, 500.0]


def test_the_concentration_of_a_small_bath_is_under_error_control():
    # A bath far smaller than the gel, whose c̄ changes first and most: within three times the tolerance of its change.
    def run(tolerance):
        ledger, bath = Ledger(), Bath("top", c=0.3, vessel=Vessel(0.05))
        scene = confined_column(model=Potential(), cells=12, baths=[bath], initial=(0.15, 0.0))
        scene.run(TIMES[-1], Adaptive(tolerance), [ledger, Area(when=TIMES)])
        return np.array([ledger.bath_c["top"][ledger.time == time][0] for time in TIMES])

    exact = run(1e-6)
    assert np.abs(run(1e-3) - exact).max() < 3e-3 * abs(exact[-1] - 0.3)


def test_growth_about_a_body_in_a_vessel_has_a_factor_of_one():
    # Fluid and salt that gel and bath hold together stay: eigenvalues of one, to the iteration's tolerance; others decay.
    scene = confined_column(model=Potential(), cells=4, baths=[Bath("top", c=0.15, vessel=BEAKER)])
    assert scene.growth_factor(10.0, scene.equilibrate()).factor == pytest.approx(1.0, abs=1e-6)
