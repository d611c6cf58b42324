"""Runs: what is refused, what a refusal leaves, how one goes on from its end."""

import math

import pytest

from ngswell import (
    Concentration,
    Fixed,
    InputError,
    Ledger,
    Multiplier,
    Newton,
    Nitsche,
    Potential,
    Probe,
)
from tests.scenes import FALLING, confined_column, strip


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"until": "1"}, "until has to be a number"),
        ({"until": math.inf}, "until = inf"),
        ({"steps": Fixed}, "steps has to be .*got the class Fixed"),
        ({"steps": 1.0}, "steps has to be .*got 1.0"),
        ({"steps": Fixed(1e-14)}, "lost in the round-off"),
        ({"observers": Ledger()}, r"observers has to be a list, got one Ledger: put it in brackets, \["),
        ({"newton": Newton}, "newton has to be .*got the class Newton"),
        ({"resume": 3.0}, "resume has to be a snapshot.*got 3.0"),
        ({"solver": "pardiso"}, "solver has to make a linear solver.*'pardiso'"),
    ],
)
def test_refused(change, words):
    with pytest.raises(InputError, match=words):
        confined_column(cells=2).run(**{"until": 1.0, **change})


def test_until_before_the_start():
    with pytest.raises(InputError, match="not a time after the start"):
        strip(start=100.0).run(50.0)


def test_a_snapshot_of_another_scene():
    end = confined_column().run(1.0, Fixed(1.0)).end
    with pytest.raises(InputError, match="unknowns"):
        strip().run(2.0, Fixed(1.0), resume=end)


def test_refusals_leave_nothing_behind():
    scene = strip()
    with pytest.raises(InputError):
        scene.run(1.0, Fixed(1.0), [Ledger(), Probe((9.0, 9.0), "J")])
    assert scene.run(1.0, Fixed(1.0)).steps[-1].time == 1.0


@pytest.mark.parametrize(
    ("model", "treatment"),
    [(Potential(), None), (Concentration(), Multiplier()), (Concentration(), Nitsche())],
)
def test_a_run_goes_on_from_its_end(model, treatment):
    def scene():
        return confined_column(treatment, c=FALLING, model=model, cells=6)

    half = scene().run(20.0, Fixed(5.0))
    resumed = scene().run(40.0, Fixed(5.0), resume=half.end).end
    through = scene().run(40.0, Fixed(5.0)).end
    assert resumed.time == through.time
    # The first step after resuming starts without an extrapolation: Newton's remainder, 1e-8 of sizes of 1 and below.
    assert resumed.values == pytest.approx(through.values, abs=1e-9)
