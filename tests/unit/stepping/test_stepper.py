"""Steps: what is refused, what they report, what a failed one leaves."""

import math

import numpy as np
import pytest

from ngswell import Adaptive, DampedNewton, Fixed, InputError, Reason, StepError, Traction
from tests.scenes import FALLING, confined_column, strip


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Fixed(0.0), "positive"),
        (lambda: Adaptive(tolerance=-1e-3), "positive"),
        (lambda: Fixed(math.inf), "finite, got inf"),
        (lambda: Fixed(1.0, "euler"), "scheme has to be BACKWARD_EULER.*'euler'"),
        (lambda: Adaptive(1e300), "above 1"),
        (lambda: Adaptive(1e-13), "lost in round-off: take 1e-12 or more"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_a_step_that_cannot_succeed_restores_the_last_state():
    # A load that squeezes out more fluid than there is: the compression point is never passed.
    scene = strip(loads=[Traction("top", (0.0, -900.0))], c=0.15)
    with pytest.raises(StepError) as caught:
        scene.run(1e4, Fixed(100.0), newton=DampedNewton(most_iterations=4))
    error = caught.value
    problem = scene.problem
    problem.initialise()
    initial = problem.vector.copy()
    problem.restore(error.end)
    assert error.time == error.end.time < 1e4
    assert error.reason in Reason
    assert f"t = {error.time:.10g} s" in str(error)
    assert problem.admissible.violation() is None
    assert np.isfinite(problem.vector).all()
    if error.time == 0.0:
        assert problem.vector == pytest.approx(initial, abs=0)


def test_steps_report_their_work():
    result = confined_column(c=FALLING).run(10.0, Adaptive(1e-3))
    assert all(step.iterations >= 1 and step.dt > 0 for step in result.steps)
    assert sum(step.dt for step in result.steps) == pytest.approx(10.0, rel=1e-12)
    assert result.iterations == sum(step.iterations for step in result.steps)
