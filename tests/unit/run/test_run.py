"""Runs: what is refused, what a refusal leaves, how one goes on from its end."""

import math

import pytest

from ngswell import (
    Area,
    Concentration,
    DampedNewton,
    Fixed,
    InputError,
    Ledger,
    Multiplier,
    Nitsche,
    Potential,
    Probe,
    Stability,
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
        ({"newton": DampedNewton}, "newton has to be .*got the class DampedNewton"),
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
    with pytest.raises(InputError, match="another mesh"):
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


def test_results_are_their_own():
    """Two runs of a scene, its rest and its growth leave each other's results, and the scene's own problem, as they are."""
    scene = confined_column(None, model=Potential(), c=FALLING, cells=4)
    scene.problem.initialise()
    untouched = scene.problem.vector.copy()
    first = scene.run(10.0, Fixed(5.0))
    J, live = first.state.at((0.5,), "J"), first.state.output("J")
    second = scene.run(40.0, Fixed(5.0))
    rest = scene.state(scene.equilibrate(40.0)).at((0.5,), "J")
    scene.growth_factor(1.0, second.end)
    assert first.state.at((0.5,), "J") == J == live(scene.mesh(0.5))
    assert J < second.state.at((0.5,), "J") < rest  # it swells
    assert (scene.problem.vector == untouched).all()
    assert scene.state(first.end).at((0.5,), "J") == J
    with pytest.raises(InputError, match=r"\(0\.6,\) is not a point of the 1-d body"):
        first.state.at((0.6,), "J")
    with pytest.raises(InputError, match="no quantity 'volume'; the model gives displacement"):
        first.state.at((0.5,), "volume")


def test_a_state_of_rest_is_recorded():
    scene = confined_column(None, model=Potential(), c=0.1, initial=(0.15, 0.0), cells=4)
    top, area, seen = Probe((0.5,), "J"), Area(), []
    rest = scene.equilibrate(5.0, observers=[top, area, lambda time, state: seen.append((time, state.at((0.5,), "J")))])
    J = scene.state(rest).at((0.5,), "J")
    assert top.time.tolist() == area.time.tolist() == [5.0]
    assert top.values["J"].tolist() == [J]
    assert seen == [(5.0, J)]
    assert area.values == pytest.approx([0.5 * J], rel=1e-12)  # homogeneous
    with pytest.raises(InputError, match="a state of rest has no duration"):
        scene.equilibrate(5.0, observers=[Stability()])
    stable = Stability(over=1e6)
    scene.equilibrate(5.0, observers=[stable])
    assert stable.rates.tolist() == [0.0]
