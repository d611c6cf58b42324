"""Small runs of random scenes: a sound result, or a documented exception that leaves a sound state; nothing else.

A watch ends what takes more than a few steps; what it has seen until then has to be as sound.
"""

from __future__ import annotations

import signal
import warnings
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from fuzzing import fuzzed, generated, log_uniform
from hypothesis import note
from hypothesis import strategies as st

from ngswell import (
    BACKWARD_EULER,
    ESDIRK4,
    Adaptive,
    Averaged,
    Bath,
    Concentration,
    Confined,
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
    Newton,
    Nitsche,
    Penalty,
    PlaneStrain,
    Potential,
    PowerLaw,
    Ramp,
    Roller,
    Scene,
    StepError,
    Traction,
    Uncharged,
    column,
    rectangle,
)
from ngswell.materials import Constant
from ngswell.observers import Observer
from studies.hard import unusable

MOST_STEPS = 8
"""Accepted steps after which the watch ends a run."""

LONGEST = 30
"""Seconds after which a run counts as hanging; the slowest take a few."""

OUTCOMES: Counter[str] = Counter()


class Enough(Exception):
    """The watch has seen what it wanted."""


class Watch(Observer):
    """Keeps the last accepted state, looks at each, and ends the run after a few."""

    def start(self, problem, begin, until):
        self.count = -1
        super().start(problem, begin, until)

    def record(self, problem, time):
        self.count += 1
        self.at, self.state = time, problem.vector.copy()
        assert np.isfinite(self.state).all(), "an accepted state is not finite"
        assert problem.time == time, "the clock is not at the accepted state"
        if self.count:  # at the start, prescribed values may still be off
            assert problem.inadmissible() is None, f"an accepted state is not admissible: {problem.inadmissible()}"
        if self.count >= MOST_STEPS:
            raise Enough


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


def between(low: float, high: float, widest: tuple[float, float], wild: bool) -> st.SearchStrategy[float]:
    """Usual values, or anything in the admissible range."""
    return log_uniform(*widest) if wild else log_uniform(low, high)


@st.composite
def trials(draw) -> Trial:
    wild = draw(st.booleans())
    model = draw(st.sampled_from([Potential, Potential, Concentration, Concentration, LocalDonnan, Uncharged]))
    charged = model is not Uncharged
    material = Material(
        mu=draw(between(0.01, 10.0, (1e-7, 1e4), wild)),
        lam=draw(st.one_of(st.just(0.0), between(0.01, 10.0, (1e-7, 1e5), wild))),
        nS0=draw(st.floats(1e-6, 1 - 1e-6) if wild else st.floats(0.05, 0.8)),
        cfc0=draw(st.one_of(st.just(0.0), between(0.01, 1.0, (1e-12, 10.0), wild))) if charged else 0.0,
        D_plus=draw(between(1e-4, 2e-3, (1e-9, 1e-1), wild)),
        D_minus=draw(between(1e-4, 2e-3, (1e-9, 1e-1), wild)),
        K=draw(between(1e-5, 1e-1, (1e-11, 1e5), wild)),
        permeability=draw(st.sampled_from([Constant(), PowerLaw(2.0), HolmesMow(1.0, 2.0)])),
        diffusivity=draw(st.sampled_from([Constant(), MackieMeares()])),
        phi=draw(st.sampled_from([1.0, 0.9])),
        phi_bath=draw(st.sampled_from([1.0, 0.95])),
        Gamma=draw(st.sampled_from([1.0, 1.1, 0.9])),
    )
    size = draw(between(0.1, 10.0, (1e-3, 1e3), wild))
    stiffness = 2 * material.mu + material.lam + material.RT * material.cfc0
    tau = size**2 / (material.K * stiffness)

    def history(values):
        """A few points within some τ; steps that are nearly sudden, kinks close to each other."""
        gaps = draw(st.lists(log_uniform(1e-9, 1.0), max_size=3))
        times = tau * np.cumsum([0.0, *gaps])
        return Ramp(*zip(times.tolist(), [draw(values) for _ in times], strict=True))

    salt = history(between(0.01, 5.0, (1e-9, 10.0), wild)) if charged else None
    hydraulic = history(st.floats(-1, 1).map(lambda share: float(np.clip(share * material.mu, -1e3, 1e3))))
    treatment = draw(st.sampled_from(TREATMENTS[model]))
    bath = Bath("top", c=salt, P=hydraulic if draw(st.booleans()) else 0.0, treatment=treatment)
    load = draw(st.one_of(st.just(0.0), log_uniform(1e-3, 30.0).map(lambda share: -share), log_uniform(1e-3, 1.0)))
    load = float(np.clip(load * material.mu, -1e3, 1e3))
    charge = draw(st.sampled_from([Ramp((0.0, 1.0)), Ramp((0.0, 0.0), (tau, 1.0)), Ramp((0.0, 0.5), (1e-6 * tau, 1.5))]))
    order = draw(st.sampled_from([2, 2, 3]))
    if draw(st.integers(0, 3)):
        cells = draw(st.integers(3, 6))
        geometry = {
            "mesh": column(size, cells, draw(st.sampled_from([None, {"top": 10.0}]))),
            "kinematics": Confined(),
            "supports": [Roller("bottom", "x")],
            "loads": [Traction("top", (load,))] if load else [],
        }
    else:
        sides = draw(st.sampled_from(["left", "left|right"]))
        geometry = {
            "mesh": rectangle(size, draw(log_uniform(0.2, 5.0)) * size, 2, 2, draw(st.booleans())),
            "kinematics": PlaneStrain(),
            "supports": [Roller("bottom", "y"), Roller(sides, "x")],
            "loads": [Traction("top", (0.0, load))] if load else [],
        }
    scene = {**geometry, "material": material, "model": model(order), "baths": [bath], "charge": charge}
    euler = isinstance(treatment, Lagged) or draw(st.booleans())
    scheme = BACKWARD_EULER if euler else ESDIRK4
    until = float(tau * draw(log_uniform(1e-6, 1e3)))
    if draw(st.booleans()):
        steps = Fixed(until / draw(st.integers(1, 6)), scheme)
    else:
        steps = Adaptive(draw(log_uniform(1e-4, 0.1)), scheme=scheme)
    return Trial(scene, steps, until, draw(st.booleans()))


@fuzzed(300, shrink=False, trial=trials())
def test_a_run_ends_soundly(trial):
    note(repr(trial))
    outcome = run(trial)
    OUTCOMES[outcome] += 1


def run(trial: Trial) -> str:
    """Runs a trial and says how it ended; what must not be is an AssertionError or another exception."""
    watch, ledger = Watch(), Ledger()
    with warnings.catch_warnings(), in_time(LONGEST):
        warnings.simplefilter("error", RuntimeWarning)
        try:
            scene = Scene(**trial.scene)
            scene.run(trial.until, trial.steps, [ledger, watch], newton=Newton() if trial.exact else None)
            outcome = "finished"
        except InputError:
            return "refused"
        except Enough:
            outcome = "enough"
        except StepError as stopped:
            check_stop(scene, stopped, watch)
            outcome = "stopped"
    problem = scene.problem
    assert not (found := unusable(scene, watch.at)) or watch.count == 0, found
    assert np.array_equal(problem.vector, watch.state)
    for name, field in problem.state.outputs().items():
        assert np.isfinite(field(problem._quadrature)).all(), f"{name} is not finite"
    if trial.exact:
        check_ledger(scene, ledger)
    return outcome


def check_stop(scene: Scene, stopped: StepError, watch: Watch) -> None:
    assert stopped.time == watch.at, "the error's time is not that of the last accepted state"
    assert 0 < stopped.step < np.inf
    assert stopped.reason
    assert len(stopped.where) == scene.mesh.dim
    assert np.isfinite(stopped.where).all()
    assert stopped.field in (*scene.problem.names, *scene.problem._bounds)
    assert "nan" not in str(stopped)


WORST: Counter[str] = Counter()


def check_ledger(scene: Scene, ledger: Ledger) -> None:
    for name, open_by in ledger.imbalance().items():
        assert np.isfinite(open_by)
        WORST[name] = max(WORST[name], open_by)


def test_inputs_were_generated():
    total = generated(__name__)
    print(dict(OUTCOMES), dict(WORST))
    assert OUTCOMES["finished"] + OUTCOMES["enough"] > total / 2
