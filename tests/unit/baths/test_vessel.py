"""Vessels: what they refuse, what they say, and runs that go on with them."""

import pytest
from ngsolve import x

from ngswell import (
    TABLE_1,
    Bath,
    Blend,
    Concentration,
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
    StepError,
    Traction,
    Vessel,
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


def test_equilibrate_refuses_what_the_past_decides():
    with pytest.raises(InputError, match="vessel"):
        confined_column(baths=[Bath("top", c=0.15, vessel=BEAKER)], model=Potential()).equilibrate()
