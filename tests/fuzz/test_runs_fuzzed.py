"""Small runs of random scenes: a sound result, or a documented exception that leaves a sound state; nothing else.

A watch ends what takes more than a few steps; what it has seen until then has to be as sound.
"""

from __future__ import annotations

import secrets
import signal
import warnings
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass
from math import exp, log
from random import Random

import numpy as np
import pytest
from ngsolve import CF, Integrate, SetNumThreads, ngsglobals

from ngswell import (
    BACKWARD_EULER,
    ESDIRK4,
    Adaptive,
    Averaged,
    Bath,
    Concentration,
    Confined,
    DampedNewton,
    Essential,
    Fixed,
    Frozen,
    HolmesMow,
    InnerLayer,
    InputError,
    Lagged,
    LeastSquares,
    Ledger,
    LocalDonnan,
    MackieMeares,
    Material,
    Multiplier,
    Nitsche,
    Penalty,
    PlaneStrain,
    Platen,
    Potential,
    PowerLaw,
    Ramp,
    Roller,
    Scene,
    StepError,
    Traction,
    Uncharged,
    UnitsWarning,
    column,
    rectangle,
)
from ngswell.errors import Reason
from ngswell.mesh.sizes import cell_size
from ngswell.observers.base import Observer
from ngswell.physics.pores import Constant
from ngswell.problem.admissible import TURNED
from ngswell.problem.problem import Problem
from ngswell.stepping.schemes import Scheme
from tests.fuzz.fuzzing import FRESH, SCALE

MOST_STEPS = 8
"""Accepted steps after which the watch ends a run."""

LONGEST = 30
"""Seconds after which a run counts as hanging; the slowest take a few."""

LEDGER_BOUND = 1e-7
"""In units of the body's volume (times the largest concentration): Newton's tolerance, 1e-8, in each of up to 8 steps."""

OUTCOMES: Counter[str] = Counter()


class Enough(Exception):
    """The watch has seen what it wanted."""


class Watch(Observer):
    """Keeps the last accepted state, looks at each, and ends the run after a few."""

    def start(self, problem, begin, until):
        self.count, self.problem = -1, problem
        super().start(problem, begin, until)

    def record(self, problem, time):
        self.count += 1
        self.at, self.state = time, problem.vector.copy()
        assert np.isfinite(self.state).all(), "an accepted state is not finite"
        assert problem.time == time, "the clock is not at the accepted state"
        if self.count:  # at the start, prescribed values may still be off
            found = problem.admissible.violation()
            assert found is None, f"an accepted state is not admissible: {found}"
        if self.count >= MOST_STEPS:
            raise Enough


@pytest.fixture(autouse=True)
def one_thread():
    """Bodies of four cells gain nothing from threads, and on a busy machine these wait for each other."""
    threads = ngsglobals.numthreads
    SetNumThreads(1)
    yield
    SetNumThreads(threads)


@contextmanager
def in_time(seconds: int):
    def late(*_):
        raise TimeoutError("the run hangs")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@dataclass(frozen=True)
class Trial:
    """A scene and how it is run; times in units of the consolidation time `tau` [s]."""

    scene: dict
    steps: Adaptive | Fixed
    until: float
    exact: bool


TREATMENTS = {
    Potential: [Essential(), Penalty(relative=1e4), Penalty(relative=1.0), Penalty(40.0)],
    Concentration: [
        Penalty(relative=1e4), Penalty(40.0), Nitsche(), Nitsche(0.0, "skew"), Nitsche(20.0, "none"), Multiplier(), Frozen(),
        Lagged(), Lagged(InnerLayer()), Lagged(Averaged()), Lagged(LeastSquares()),
    ],
    LocalDonnan: [Essential(), Penalty(relative=1e4)],
    Uncharged: [Essential(), Penalty(relative=1e4)],
}  # fmt: skip


class Dice:
    """Random values; the same for the same seed."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)

    def one(self, *choices):
        return self.random.choice(choices)

    def log(self, low: float, high: float) -> float:
        """Every order of magnitude alike, the ends now and then."""
        exponent = self.random.uniform(log(low), log(high))
        return self.one(low, high) if self.random.random() < 0.1 else min(high, max(low, exp(exponent)))

    def flat(self, low: float, high: float) -> float:
        return self.random.uniform(low, high)


def trial_of(seed: int) -> Trial:
    """Usual parameters or, in half of the trials, any admissible ones; histories with sudden steps and close kinks."""
    dice = Dice(seed)
    wild = dice.one(True, False)

    def size_of(low: float, high: float, least: float, most: float) -> float:
        return dice.log(least, most) if wild else dice.log(low, high)

    model = dice.one(Potential, Potential, Concentration, Concentration, LocalDonnan, Uncharged)
    charged = model is not Uncharged
    material = Material(
        mu=size_of(0.01, 10.0, 1e-7, 1e4),
        lam=dice.one(0.0, size_of(0.01, 10.0, 1e-7, 1e5)),
        nS0=dice.flat(1e-6, 1 - 1e-6) if wild else dice.flat(0.05, 0.8),
        cfc0=dice.one(0.0, *[size_of(0.01, 1.0, 1e-12, 10.0)] * 3) if charged else 0.0,
        D_plus=size_of(1e-4, 2e-3, 1e-8, 1e-1),
        D_minus=size_of(1e-4, 2e-3, 1e-8, 1e-1),
        K=size_of(1e-5, 1e-1, 1e-11, 1e5),
        permeability=dice.one(Constant(), PowerLaw(2.0), HolmesMow(1.0, 2.0)),
        diffusivity=dice.one(Constant(), MackieMeares()),
        phi=dice.one(1.0, 0.9),
        phi_bath=dice.one(1.0, 0.95),
        Gamma=dice.one(1.0, 1.1, 0.9),
    )
    size = size_of(0.1, 10.0, 1e-3, 1e3)
    stiffness = 2 * material.mu + material.lam + material.RT * material.cfc0
    tau = min(1e11, max(1e-6, size**2 / (material.K * stiffness)))  # [s]

    def history(values) -> Ramp:
        times = np.cumsum([0.0, *(tau * dice.log(1e-9, 1.0) for _ in range(dice.one(0, 1, 2, 3)))])
        return Ramp(*((float(time), values()) for time in np.unique(times)))

    hydraulic = min(material.mu, 1e3)
    treatment = dice.one(*TREATMENTS[model])
    bath = Bath(
        "top",
        c=history(lambda: size_of(0.01, 5.0, 1e-9, 10.0)) if charged else None,
        P=history(lambda: dice.flat(-hydraulic, hydraulic)) if dice.one(True, False) else 0.0,
        treatment=treatment,
    )
    load = dice.one(0.0, -dice.log(1e-3, 30.0), dice.log(1e-3, 1.0), -stiffness / material.mu * dice.log(1e-3, 1.0))
    load = min(1e3, max(-1e3, load * material.mu))
    charge = dice.one(Ramp((0.0, 1.0)), Ramp((0.0, 0.0), (tau, 1.0)), Ramp((0.0, 0.5), (1e-6 * tau, 1.5)))
    if dice.one(True, True, True, False):
        geometry = {
            "mesh": column(size, dice.one(3, 4, 5, 6), dice.one(None, {"top": 10.0})),
            "kinematics": Confined(),
            "supports": [Roller("bottom", "x")],
            "loads": [Traction("top", (load,))] if load else [],
        }
    else:
        geometry = {
            "mesh": rectangle(size, size * dice.log(0.2, 5.0), 2, 2, dice.one(True, False)),
            "kinematics": PlaneStrain(),
            "supports": [Roller("bottom", "y"), Roller(dice.one("left", "left|right"), "x")],
            "loads": [Traction("top", (0.0, load))] if load else [],
        }
    scene = {**geometry, "material": material, "model": model(dice.one(2, 2, 3)), "baths": [bath], "charge": charge}
    scheme = BACKWARD_EULER if isinstance(treatment, Lagged) else dice.one(BACKWARD_EULER, ESDIRK4)
    until = tau * dice.log(1e-6, 1e3)
    steps = dice.one(Fixed(until / dice.one(1, 2, 3, 4, 5, 6), scheme), Adaptive(dice.log(1e-4, 0.1), scheme=scheme))
    exact = dice.one(True, False)
    moved = dice.one(None, None, None, None, "displacement", "force")  # drawn last: the other trials stay what they were
    if moved:
        way = size_of(0.01, 0.3, 1e-6, 30.0) * size if moved == "displacement" else min(1e3, abs(load) or hydraulic) * size
        amount = dice.one(-1, -1, 1) * way
        push = Ramp((0.0, 0.0), (tau * dice.log(1e-9, 1.0), amount), (2 * tau, dice.one(amount, amount, 0.0)))
        scene |= {"loads": [], "supports": [*scene["supports"], Platen("top", **{moved: push}, glued=dice.one(True, False))]}
    return Trial(scene, steps, until, exact)


FIRST = secrets.randbelow(10**9) if FRESH else 0
SEEDS = range(FIRST, FIRST + round(300 * SCALE))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_run_ends_soundly(seed):
    OUTCOMES[run(trial_of(seed))] += 1


def run(trial: Trial) -> str:
    """Runs a trial and says how it ended; what must not be is an AssertionError or another exception."""
    watch, ledger = Watch(), Ledger()
    with warnings.catch_warnings(), in_time(LONGEST):
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", UnitsWarning)  # wild numbers are meant
        try:
            scene = Scene(**trial.scene)
            newton = DampedNewton() if trial.exact else None
            end = scene.run(trial.until, trial.steps, [ledger, watch], newton=newton, unstable="off").end
            outcome = "finished"
        except InputError:
            return "refused"
        except Enough:
            end, outcome = watch.problem.snapshot(watch.problem.time), "enough"
        except StepError as stopped:
            check_stop(watch.problem, stopped, watch)
            end, outcome = stopped.end, "stopped"
    problem = watch.problem  # the run's own
    assert problem.time == end.time == watch.at
    assert np.isfinite(problem.vector).all()
    assert np.array_equal(problem.vector, watch.state)
    assert np.array_equal(end.values, watch.state)
    assert (found := problem.admissible.violation()) is None or watch.count == 0, found
    for name, field in problem.state.outputs().items():
        assert np.isfinite(field(problem.points)).all(), f"{name} is not finite"
    for name, field in scene.state(end).outputs().items():
        assert np.array_equal(field(problem.points), problem.state.outputs()[name](problem.points), equal_nan=True), name
    check_ions(problem)
    if trial.exact:
        check_ledger(problem, ledger, trial.steps.scheme)
    return outcome


def check_stop(problem: Problem, stopped: StepError, watch: Watch) -> None:
    assert stopped.time == watch.at, "the error's time is not that of the last accepted state"
    assert 0 < stopped.step < np.inf
    assert isinstance(stopped.reason, Reason)
    assert len(stopped.where) == problem.mesh.dim
    assert np.isfinite(stopped.where).all()
    assert stopped.field in (*problem.names, *problem.admissible.always, *problem.admissible.in_solutions, TURNED)
    assert "nan" not in str(stopped)


WORST: Counter[str] = Counter()


def check_ledger(problem: Problem, ledger: Ledger, scheme: Scheme) -> None:
    """What the nonlinear solves leave, in units of the body's volume and, for ions, of the largest concentration.

    Beside their tolerance it is the flow that round-off of pressure and concentration drives through a cell in the time of
    the run: Holmes and Mow's permeability of a body that swells ten times is beyond 1e40 of the initial one. And a step of
    ESDIRK4 takes over the rates that the contents of the step before tell, whose round-off grows with the ratio of both.
    """
    where, m = problem.points, problem.setup.material
    volume, h = float(Integrate(CF(1.0), problem.mesh)), cell_size(problem.mesh, "top")
    sizes = {"fluid": volume, "cations": volume * problem.references.get("salt", problem.references.get("c", 1.0))}
    pressure = m.mu + float(np.abs(problem.state.outputs()["p"](where)).max())
    mobility = float(np.max(CF(problem.state.permeability)(where))) * pressure + max(m.D_plus, m.D_minus)
    steps = np.diff(ledger.time)
    driven = mobility * steps.sum() / h**2
    if scheme is ESDIRK4 and len(steps) > 1:
        driven += np.max(steps[1:] / steps[:-1])
    driven *= 16 * np.finfo(float).eps
    for name, open_by in ledger.imbalance().items():
        found = open_by * np.abs(getattr(ledger, name)).max() / sizes[name]
        if driven < LEDGER_BOUND:
            WORST[name] = max(WORST[name], found)
        assert found <= LEDGER_BOUND + driven, f"the ledger of {name} is open by {open_by:.3g}"


def check_ions(problem: Problem) -> None:
    """Anions are positive by themselves where they follow from c̃ or the bath. As a difference, in `Concentration`, they

    undershoot on cells as coarse as these; c₊ c₋ + cfc(J)²/4 > 0 is what its pressure needs and Newton's method keeps.
    """
    state, outputs = problem.state, problem.state.outputs()
    if "c_minus" not in outputs:
        return
    where = problem.points
    plus, minus, charge = (np.asarray(f(where)) for f in (outputs["c_plus"], outputs["c_minus"], state.pointwise_charge))
    if isinstance(problem.model, Concentration):
        WORST["anions below zero"] = max(WORST["anions below zero"], -float(minus.min()) / problem.references["c"])
        assert (plus * minus + charge**2 / 4 > 0).all()
    else:
        assert minus.min() > 0


def test_most_runs_go_somewhere():
    print(dict(OUTCOMES), dict(WORST))
    if sum(OUTCOMES.values()) < len(SEEDS):
        pytest.skip("only some of the runs were made, or some failed")
    assert OUTCOMES["finished"] + OUTCOMES["enough"] > len(SEEDS) / 2
