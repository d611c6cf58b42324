"""Records between steps: their order, that they cost no steps, and that a run that resumes has them, too."""

from contextlib import suppress
from math import exp

import numpy as np
import pytest

from ngswell import (
    BACKWARD_EULER,
    ESDIRK4,
    TABLE_1,
    Adaptive,
    Area,
    Bath,
    Checkpoint,
    Confined,
    Cylindrical,
    Fixed,
    InputError,
    Integral,
    Material,
    Observer,
    Outflow,
    Potential,
    Probe,
    Ramp,
    Reaction,
    Roller,
    Scene,
    Sine,
    Symmetry,
    Traction,
    Uncharged,
    column,
    ray,
)
from ngswell.stepping.schemes import Scheme
from tests.scenes import P0

# -- the interpolant ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.0, 0.1, 0.37, 0.8, 1.0])
def test_the_interpolant_is_exact_for_polynomials(share):
    times = np.array(ESDIRK4.times)
    for power in range(5):
        assert ESDIRK4.interpolation(share) @ times**power == pytest.approx(share**power, abs=1e-12)
    assert BACKWARD_EULER.interpolation(share) @ [3.0, 5.0] == pytest.approx(3 + 2 * share)
    assert np.abs(ESDIRK4.interpolation(share)).sum() < 4  # what it multiplies errors of the stages by
    ends = {0.0: [1, 0, 0, 0, 0, 0], 1.0: [0, 0, 0, 0, 0, 1]}
    if share in ends:
        assert ESDIRK4.interpolation(share) == pytest.approx(np.array(ends[share]), abs=1e-12)


def stages_of_decay(scheme: Scheme, dt: float, rate: float) -> np.ndarray:
    """States of x′ = −rate (x − cos t) − sin t at the stages of a step from x = 2, t = 0.3; exact: cos t + decay."""
    start = np.cos(0.3) + 1.0

    def slope(x, share):
        return -rate * (x - np.cos(0.3 + share * dt)) - np.sin(0.3 + share * dt)

    states, slopes = [start], [slope(start, 0.0)]
    for row, share in list(zip(scheme.rows, scheme.times, strict=True))[1:]:
        known = start + dt * np.array(row[:-1]) @ np.array(slopes)
        driven = rate * np.cos(0.3 + share * dt) - np.sin(0.3 + share * dt)
        states.append((known + dt * row[-1] * driven) / (1 + dt * row[-1] * rate))
        slopes.append(slope(states[-1], share))
    return np.array(states)


@pytest.mark.parametrize("rate", [1.0, 3.0])
def test_the_order_within_a_step(rate):
    def error(dt):
        states = stages_of_decay(ESDIRK4, dt, rate)
        shares = np.linspace(0, 1, 41)
        exact = [np.cos(0.3 + s * dt) + exp(-rate * s * dt) for s in shares]
        return max(abs(ESDIRK4.interpolation(s) @ states - e) for s, e in zip(shares, exact, strict=True))

    assert np.log2(error(0.05) / error(0.025)) == pytest.approx(4, abs=0.4)  # of a step; one less of a run


# -- in runs -----------------------------------------------------------------------------------------------------------


def gel(bath=None, **changes) -> Scene:
    parts = {"supports": [Roller("bottom", "x")], "initial": (0.15, 0.0), "model": Potential()}
    return Scene(
        mesh=column(0.5, 8, grade={"top": 6}), kinematics=Confined(), material=TABLE_1,
        baths=[Bath("top", c=bath or Ramp((0, 0.15), (100, 0.1)))], **parts | changes,
    )  # fmt: skip


def pressed() -> Scene:
    """A disc between rigid walls that come nearer: the force relaxes."""
    return Scene(
        mesh=ray(0.0, 1.0, 8, grade={"outer": 6}), kinematics=Cylindrical(), model=Uncharged(),
        material=Material(mu=0.24, lam=0.1, nS0=0.25, K=1e-3), baths=[Bath("outer")],
        supports=[Symmetry("inner"), Roller("outer", "r", Ramp((0, 0.0), (50, -0.05)))],
    )  # fmt: skip


TIMES = np.sort(np.random.default_rng(1).uniform(5.0, 200.0, 60))


def watched(scene, steps, **how):
    """Histories at TIMES, one row a quantity."""
    if scene.kinematics == Cylindrical():
        observers = [Reaction("outer", TIMES, **how), Probe((0.0,), "p", when=TIMES, **how)]
    else:
        observers = [Probe((0.5,), "displacement", when=TIMES, **how), Probe((0.25,), "p", "c_plus", when=TIMES, **how)]
    result = scene.run(200.0, steps, observers)
    rows = [np.ravel(values) for o in observers for values in o._table.columns().values()]
    for observer in observers:
        assert observer.time == pytest.approx(TIMES, rel=1e-12)
    return np.array(rows), result


def linear(scene, steps):
    """The same by straight lines between the records of steps: the control."""
    observers = [Reaction("outer")] if scene.kinematics == Cylindrical() else [Probe((0.5,), "displacement")]
    scene.run(200.0, steps, observers)
    (values,) = observers[0]._table.columns().values()
    return np.interp(TIMES, observers[0].time, np.ravel(values))


def off(found, exact):
    return np.abs(found - exact).max(axis=-1) / np.ptp(exact, axis=-1)


@pytest.mark.parametrize("scene", [gel, pressed])
def test_errors_follow_the_tolerance(scene):
    exact, _ = watched(scene(), Adaptive(1e-7))
    errors = []
    for tolerance in (1e-3, 1e-4, 1e-5):
        found, _ = watched(scene(), Adaptive(tolerance), dense=True)
        errors.append(off(found, exact))
        # Adaptive's promise for the ends of steps; measured 0.05 to 0.6 of the tolerance (u, p, c₊), to 1.1 (the force).
        assert (errors[-1] < 3 * tolerance).all()
    control = off(linear(scene(), Adaptive(1e-4)), exact[0])
    assert control > 20 * errors[1][0]


def test_the_order_in_runs():
    """Steps halved, a smooth bath: u, p and c₊ are of the scheme's order, between three and four or above, between steps."""
    bath = Sine(0.15, 0.03, 400.0, 1)

    def run(steps):
        return watched(gel(bath, loads=[Traction("top", (-P0,))]), Fixed(200.0 / steps, ESDIRK4), dense=True)[0]

    exact = run(320)
    errors = np.array([off(run(steps), exact) for steps in (20, 40, 80)])
    # Measured 4.6, 3.8, 3.4 and 5.1, 4.1, 3.8.
    assert (np.log2(errors[:-1] / errors[1:]) > 2.8).all()


def test_backward_euler_is_linear_between_its_steps():
    step = 10.0
    found, _ = watched(gel(), Fixed(step), dense=True)
    assert found[0] == pytest.approx(linear(gel(), Fixed(step)), rel=1e-12)


def test_records_cost_no_steps_and_change_none():
    plain, dense = gel().run(200.0, Adaptive(1e-3)), watched(gel(), Adaptive(1e-3), dense=True)[1]
    landed = watched(gel(), Adaptive(1e-3))[1]
    assert [step.time for step in dense.steps] == [step.time for step in plain.steps]
    assert np.array_equal(dense.end.values, plain.end.values)
    assert len(landed.steps) > 2 * len(dense.steps)  # the control: one step a record


def test_times_at_ends_of_steps_and_of_the_run_are_those_of_the_steps():
    every, dense = Probe((0.5,), "J"), Probe((0.5,), "J", when=10.0, dense=True)
    whole = Area(50.0, dense=True)
    gel().run(100.0, Fixed(10.0, ESDIRK4), [every, dense, whole])
    assert np.array_equal(every.time, dense.time)
    assert dense.values["J"] == pytest.approx(every.values["J"], rel=1e-12)
    assert whole.time.tolist() == [0.0, 50.0, 100.0]


def test_a_run_that_resumes_has_the_same_records(tmp_path):
    def observers(place=None):
        return [Probe((0.5,), "J", when=7.0, dense=True), Integral("p", when=TIMES, dense=True, to=place)]

    whole = observers()
    gel().run(200.0, Adaptive(1e-3), whole)
    for until in (90.0, 200.0):
        parts, stop = observers(tmp_path / "p.csv"), _Stop(until)
        with suppress(KeyboardInterrupt):
            gel().run(200.0, Adaptive(1e-3), [*parts, stop], checkpoint=Checkpoint(tmp_path / "run.ckpt", every=0.0))
    assert stop.time[0] > 50.0  # the second run went on where the first was stopped
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(one.time, other.time)
        assert all(np.array_equal(a, b) for a, b in zip(one.table().values(), other.table().values(), strict=True))


class _Stop(Observer):
    """Ctrl-C after a time [s]."""

    def __init__(self, time):
        super().__init__()
        self.at = time

    def record(self, problem, time):
        if self.at <= time < 200.0:
            raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Probe((0.5,), "J", dense=True), "Probe: dense records lie between steps, at times `when`"),
        (lambda: Reaction("top", dense=True), "Reaction: dense"),
        (lambda: Area(1.0, dense=1), "dense has to be True or False"),
        (lambda: Outflow("top", when=1.0, dense=True), "no argument 'dense'"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
