"""Orders in time, what a tolerance means, and what happens where stages of higher order have no solution."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import confined_column

from ngswell import (
    BACKWARD_EULER,
    ESDIRK4,
    Adaptive,
    Concentration,
    Essential,
    Fixed,
    Newton,
    Nitsche,
    Penalty,
    Potential,
    Probe,
    Ramp,
)

FALLING = Ramp((0, 0.15), (10, 0.125))  # s, mol/l
EXACT = Newton(tolerance=1e-13, most_iterations=40)

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
    assert error > tolerance / 10  # not bought with needless steps
    assert len(result.steps) < 60  # backward Euler would need a thousand for 1e-4
    assert result.factorisations < 1.5 * len(result.steps)  # five stages with one matrix
