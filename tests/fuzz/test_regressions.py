"""What fuzzed runs have found, each as the smallest run that showed it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    Adaptive,
    Bath,
    Concentration,
    DampedNewton,
    Fixed,
    InputError,
    Ledger,
    Penalty,
    Potential,
    Ramp,
    Scene,
    Snapshots,
    StepError,
    Traction,
)
from ngswell.errors import Failure, Reason
from ngswell.physics import donnan
from ngswell.solve.direct import LinearSolver
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.newton import Outcome
from tests.scenes import confined_column

SOFT = replace(TABLE_1, lam=0.0, cfc0=0.0)
"""Nothing keeps it from the compression point."""


def scene(**changes) -> Scene:
    return confined_column(None, cells=3, **{"model": Potential(), "loads": [], **changes})


class Balks(DampedNewton):
    """Fails on the first of two attempts at a step, as where the extrapolated start is not admissible."""

    def solve(self, problem, factorisation, shares=None):
        attempts = self.__dict__["attempts"] = self.__dict__.get("attempts", -1) + 1
        balks = Outcome(0, Failure(Reason.STALLED, "u", (0.0,)))
        return balks if attempts % 2 else super().solve(problem, factorisation)


@pytest.mark.parametrize("model", [Potential(), Concentration()])
def test_a_retried_step_keeps_the_contents_before_a_ramp_of_the_charge(model):
    # The retry without extrapolation took S(x_old) with the charge at the end of the step: in Potential, whose cations
    # follow from the charge, a third of them vanished.
    ledger, newton = Ledger(), Balks()
    made = scene(model=model, charge=Ramp((0.0, 0.9), (60.0, 1.0)), baths=[Bath("top", c=0.15, treatment=Penalty(1.0))])
    made.run(60.0, Fixed(10.0), [ledger], newton=newton)
    assert newton.__dict__["attempts"] == 10  # the first step has nothing to extrapolate, each other is solved twice
    assert max(ledger.imbalance().values()) < 1e-10  # what quadratic Newton iterations leave


def test_a_state_without_pressure_is_not_admissible():
    # Anions that undershoot far enough leave no root for the momentum balance's pressure: stress was NaN in accepted states.
    problem = scene(model=Concentration(), baths=[Bath("top", c=0.15, treatment=Penalty(1.0))]).problem
    problem.initialise()
    assert problem.admissible.violation() is None
    c, cfc = (problem.fields.components[problem.names.index(name)] for name in ("c", "cfc"))
    c.vec[:] = 0.05
    cfc.vec[:] = 0.2  # c (c − cfc) = −0.0075, less is left than cfc²/4 = 0.01 by 0.0025
    assert problem.admissible.violation() is None
    cfc.vec[:] = 0.3
    assert not np.isfinite(problem.state.outputs()["stress"](problem.mesh(0.1))).all()
    assert problem.admissible.violation()[0] == "c̃² + cfc²/4"


@pytest.mark.parametrize("choice", [Potential(), Concentration()])
def test_the_last_correction_leaves_the_fields_admissible(choice):
    # The correction that passes the test of convergence was applied unseen: c̃ of accepted states fell below zero.
    problem = scene(model=choice, baths=[Bath("top", c=0.15, treatment=Penalty(1.0))]).problem
    problem.initialise()
    problem.begin_step(1.0, 1.0)
    salt = problem.ranges[problem.model.balanced["cations"]]

    class Overshoots(LinearSolver):
        """Answers with a long shift of the body, then with a correction within the tolerance that takes all salt away."""

        def renew(self, problem):
            return True

        def solve(self, right, solution, prescribed=None):
            self.solves += 1
            solution[:] = 0.0
            if self.solves == 1:
                solution.FV().NumPy()[: problem.mesh.nv] = 10.0
            else:
                solution.FV().NumPy()[salt] = problem.vector[salt]
            return True

    solver = Overshoots(problem.free)
    assert DampedNewton(tolerance=1.0, slowest=0.3).solve(problem, Factorisation(solver, slowest=0.3)).failure is None
    assert solver.solves == 2  # both answers
    assert problem.admissible.violation() is None


def test_a_run_may_end_a_rounding_after_a_kink():
    # 0.1 + 0.2 > 0.3: from the kink nothing but round-off was left, which no step covers: ValueError from min().
    bath = Bath("top", c=Ramp((0.0, 0.15), (0.3, 0.14)))
    assert scene(baths=[bath]).run(0.1 + 0.2, Fixed(0.1)).steps[-1].time == 0.1 + 0.2


def test_a_record_may_lie_a_rounding_before_the_end():
    # Likewise from a time that an observer asks for.
    kept = Snapshots([10 * (1 - 5e-13)])
    assert scene().run(10.0, Fixed(5.0), [kept]).steps[-1].time == 10.0
    assert len(kept.states) == 1


def test_the_end_has_to_differ_from_the_start_by_more_than_round_off():
    with pytest.raises(InputError, match="not a time after the start"):  # it was the same ValueError
        scene(start=1e13).run(1e13 + 1, Fixed(1.0))


def test_a_run_of_picoseconds_ends():
    # The clock tells 1e-12 s; a step that ended closer to the end than that left nothing to step to: the ValueError again.
    assert scene().run(1e-11, Fixed(1.55e-12)).steps[-1].time == 1e-11
    with pytest.raises(InputError, match="lost in the round-off"):
        scene().run(5e-12, Fixed(3.1e-13))


def test_a_step_between_close_kinks_gives_up():
    # No step shorter than what the clock tells is tried; that the only one fails would be tried for ever.
    crushing = Traction("top", (-1000.0,))
    bath = Bath("top", c=Ramp((0.0, 0.15), (2e-12, 0.14), (60.0, 0.1)))
    with pytest.raises(StepError) as stopped:
        scene(loads=[crushing], baths=[bath], material=SOFT).run(60.0, Fixed(30.0))
    assert stopped.value.time == 0.0


@pytest.mark.parametrize("steps", [Fixed(1e-9), Adaptive(1e-3, largest=1e-9)])
def test_steps_lost_in_the_round_off_of_the_time_are_refused(steps):
    with pytest.raises(InputError, match="lost in the round-off"):  # a step of 0 s: ZeroDivisionError
        scene(start=1e9).run(1e9 + 1, steps)


def test_a_crushed_body_stops_at_late_times_too():
    # Rejected steps shrank below the round-off of the time: ZeroDivisionError. Without charge and λ nothing bears the load.
    soft = scene(material=replace(TABLE_1, cfc0=0.0, lam=0.0), loads=[Traction("top", (-1000.0,))], start=1e9)
    with pytest.raises(StepError) as stopped:
        soft.run(1e9 + 10, Fixed(1.0))
    assert stopped.value.time == stopped.value.end.time == 1e9
    soft.problem.restore(stopped.value.end)
    assert soft.problem.admissible.violation() is None


def test_pressures_of_a_nearly_uncharged_gel_are_not_negative():
    # Whatever the round-off of the difference in (38).
    baths = np.geomspace(1e-12, 10, 40)
    assert all((donnan.pressure(baths, cfc + 0 * baths, TABLE_1.RT) >= 0).all() for cfc in (0.0, 1e-12, 1e-9))
