"""Orders in time, what a tolerance means, and what happens where stages of higher order have no solution."""

from __future__ import annotations

import numpy as np
import pytest

from ngswell import (
    BACKWARD_EULER,
    ESDIRK4,
    Adaptive,
    Concentration,
    DampedNewton,
    Essential,
    Fixed,
    InputError,
    Lagged,
    Ledger,
    Nitsche,
    Penalty,
    Potential,
    Probe,
)
from tests.scenes import FALLING, confined_column

EXACT = DampedNewton(tolerance=1e-13, most_iterations=40)

MODELS = {
    "Concentration": (Concentration(), Penalty(relative=1e4)),
    "Concentration, Nitsche": (Concentration(), Nitsche()),
    "Potential": (Potential(), Essential()),
}


def column(choice):
    model, treatment = MODELS[choice]
    return confined_column(treatment, c=FALLING, cells=10, model=model)


def at_forty_seconds(choice, control, newton=EXACT):
    """u, p and c₊ in the middle and p at the top, 30 s after the kink of the bath."""
    middle, top = Probe((0.25,), "displacement", "p", "c_plus"), Probe((0.5,), "displacement")
    column(choice).run(40.0, control, [middle, top], newton=newton)
    return np.array([series.ravel()[-1] for probe in (middle, top) for series in probe.values.values()])


@pytest.mark.parametrize("choice", MODELS)
def test_fourth_order_across_a_kink(choice):
    reference, coarse, fine = (at_forty_seconds(choice, Fixed(dt, ESDIRK4)) for dt in (0.5, 5.0, 2.5))
    observed = np.log2(np.abs(coarse - reference) / np.abs(fine - reference))
    # Fourth order; the layer at the bath, whose modes are stiff at these steps, still costs up to half an order.
    assert observed.min() > 3.4


@pytest.mark.parametrize("choice", MODELS)
def test_backward_euler_agrees_to_first_order(choice):
    # Two schemes that share the forms but neither weights nor predictors nor error estimates.
    reference, coarse, fine = (
        at_forty_seconds(choice, control) for control in (Fixed(1.25, ESDIRK4), Fixed(1.25), Fixed(0.625, BACKWARD_EULER))
    )
    assert np.log2(np.abs(coarse - reference) / np.abs(fine - reference)) == pytest.approx(np.ones(4), abs=0.15)


@pytest.mark.parametrize("choice", ["Concentration", "Potential"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5])
def test_tolerance_is_the_error_reached(choice, tolerance):
    top = Probe((0.5,), "displacement")
    result = column(choice).run(300.0, Adaptive(tolerance), [top])
    reference = Probe((0.5,), "displacement", when=top.time.tolist())
    column(choice).run(300.0, Adaptive(1e-7), [reference], newton=EXACT)
    exact = reference.values["displacement"]
    error = np.abs(top.values["displacement"] - exact).max() / np.abs(exact).max()
    assert error < 3 * tolerance
    # Not bought with needless steps: what is stiff has an error near the bound, the top of a column a tenth of it.
    assert error > tolerance / 30
    assert len(result.steps) < 60  # backward Euler would need a thousand for 1e-4
    # Five stages with one matrix, one for a step that is rejected, some for what is expected at each of two kinks.
    rejected = sum(len(step.rejected) for step in result.steps)
    assert result.factorisations < 1.5 * (len(result.steps) + rejected) + 8


@pytest.mark.parametrize("choice", ["Concentration", "Potential"])
def test_ledger_closes_to_what_the_nonlinear_solves_leave(choice):
    def imbalance(newton):
        ledger = Ledger()
        column(choice).run(300.0, Adaptive(1e-3), [ledger], newton=newton)
        return max(ledger.imbalance().values())

    assert imbalance(DampedNewton()) < 1e-10  # quadratic remainders of full Newton iterations
    loose = imbalance(None)
    assert 1e-10 < loose < 1e-3  # solves to 3e-6; stiff fluxes amplify what they leave, up to the tolerance itself


def test_old_matrices_serve_and_change_nothing():
    kept, own = Probe((0.5,), "displacement"), Probe((0.5,), "displacement")
    few = column("Potential").run(300.0, Fixed(10.0, ESDIRK4), [kept], newton=DampedNewton(1e-10, slowest=0.3))
    many = column("Potential").run(300.0, Fixed(10.0, ESDIRK4), [own], newton=DampedNewton(1e-10))
    assert few.factorisations < many.factorisations / 10
    # Both solve to 1e-10 of the fields, 0.5 mm for u; 30 steps of five stages.
    assert kept.values["displacement"] == pytest.approx(own.values["displacement"], abs=150 * 1e-10 * 0.5)


def test_vanishing_anions_are_left_to_backward_euler():
    # At 1e-9 mol/l stages that weigh rates negatively have no solution; the step says what it tried, the run goes on.
    scene = confined_column(Essential(), c=1e-9, model=Potential(3), cells=10, initial=(0.15, 0.0))
    result = scene.run(1e5, Adaptive(1e-2))
    reasons = [str(rejection) for step in result.steps for rejection in step.rejected]
    assert any("stalls" in reason or "positive" in reason or "error" in reason for reason in reasons)
    salt = result.end.values[scene.problem.ranges["salt"]]
    assert salt[: scene.mesh.nv].min() > 0  # values at the vertices
    # Of 0.15 mol/l the rest is error in time: a hundredth of the tolerance; 1e-6 to 3e-6 as solves leave more or less.
    assert salt[: scene.mesh.nv].max() < 0.15 * 1e-2 / 100


def test_lagged_baths_need_backward_euler():
    scene = confined_column(Lagged(), c=FALLING, cells=4)
    with pytest.raises(InputError, match=r"'top', prescribed with the charge of the last step.*scheme=BACKWARD_EULER"):
        scene.run(10.0, Adaptive(1e-2))
    assert len(scene.run(10.0, Adaptive(1e-2, scheme=BACKWARD_EULER)).steps) > 3


def test_resumed_runs_reach_the_same_error():
    # A resumed run starts from the rate at its state, not from rest.
    through, first, second = (Probe((0.5,), "displacement") for _ in range(3))
    column("Potential").run(80.0, Adaptive(1e-4), [through])
    half = column("Potential").run(33.0, Adaptive(1e-4), [first]).end
    column("Potential").run(80.0, Adaptive(1e-4), [second], resume=half)
    ends = [probe.values["displacement"].ravel()[-1] for probe in (through, second)]
    assert ends[0] == pytest.approx(ends[1], rel=2 * 3e-4)  # each within three times its tolerance
