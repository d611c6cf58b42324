"""Runge–Kutta tableaus against their order conditions."""

from __future__ import annotations

import numpy as np
import pytest

from ngswell import BACKWARD_EULER, ESDIRK4
from ngswell.stepping.attempts import parabola_at


def tableau(scheme):
    """A and c."""
    a = np.zeros((len(scheme.rows),) * 2)
    for number, row in enumerate(scheme.rows):
        a[number, : len(row)] = row
    return a, np.array(scheme.times)


def conditions(a, b, c):
    """Defects of the conditions up to fourth order, by order (Butcher's rooted trees)."""
    return [
        [b.sum() - 1],
        [b @ c - 1 / 2],
        [b @ c**2 - 1 / 3, b @ a @ c - 1 / 6],
        [b @ c**3 - 1 / 4, (b * c) @ a @ c - 1 / 8, b @ a @ c**2 - 1 / 12, b @ a @ a @ c - 1 / 24],
    ]


def order(a, b, c):
    """Number of orders whose conditions hold to round-off of coefficients of about one."""
    return next((n for n, defects in enumerate(conditions(a, b, c)) if np.abs(defects).max() > 1e-13), 4)


@pytest.mark.parametrize("scheme", [BACKWARD_EULER, ESDIRK4], ids=str)
def test_order_and_stiff_accuracy(scheme):
    a, c = tableau(scheme)
    assert order(a, a[-1], c) == scheme.order
    assert c[-1] == pytest.approx(1.0, abs=1e-15)  # the last stage is the end of the step
    assert {row[-1] for row in scheme.rows} <= {0.0, scheme.diagonal}  # one matrix for all stages


def test_embedded_solution_is_one_order_lower():
    a, c = tableau(ESDIRK4)
    assert order(a, np.array(ESDIRK4.embedded), c) == 3
    assert ESDIRK4.power == 4  # its error: one order more than the embedded solution's


def test_the_estimate_is_low_by_up_to_16_in_stiff_modes():
    # Of y' = λ(y − t) from 0, z = λ Δt: what SAFETY_AFTER_KINK is made for. Both errors in units of the step.
    a, _ = tableau(ESDIRK4)
    embedded, ones = np.array(ESDIRK4.embedded), np.ones(len(a))

    def low(z):
        stages = np.linalg.solve(np.eye(len(a)) - z * a, ones)
        estimate = (a[-1] - embedded) @ stages / (1 - z * ESDIRK4.diagonal)
        return (1 + z * a[-1] @ stages - np.exp(z)) / z / estimate

    ratios = [low(z) for z in -np.logspace(-1, 4, 200)]
    assert max(ratios) < 16
    assert low(-10.0) > 14 > 4 > low(-1.0)  # the control: stiff modes only


def test_stages_are_of_second_order():
    a, c = tableau(ESDIRK4)
    assert a @ c == pytest.approx(c**2 / 2, abs=1e-15)


@pytest.mark.parametrize("z", [-1e3, -1e6])
def test_stiff_modes_are_damped(z):
    # R(z) = (last stage) of y' = z y. A-stable alone would be 1 in size; L-stable falls as 1/z, here with a factor below 10.
    a, _ = tableau(ESDIRK4)
    assert abs(np.linalg.solve(np.eye(len(a)) - z * a, np.ones(len(a)))[-1]) < 10 / abs(z)


@pytest.mark.parametrize(("count", "degree"), [(1, 0), (2, 1), (3, 2), (5, 2)])
def test_what_a_stage_starts_from_is_exact_for_parabolas(count, degree):
    times = np.array([1e6, 1e6 + 40, 1e6 + 70, 1e6 + 130, 1e6 + 150])[:count]  # steps far shorter than the time itself

    def course(time):
        return np.array([1.0, -3.0]) + ((time - 1e6) / 50) ** degree

    found = parabola_at([(time, course(time)) for time in times], 1e6 + 200)
    assert found == pytest.approx(course(1e6 + 200), rel=1e-12)  # times exact, weights of about one: round-off


def test_what_a_stage_starts_from_is_of_least_squares():
    times = [0.0, 0.5, 0.6, 0.7, 1.0]
    noise = np.array([1.0, -2.0, 0.5, 1.5, -1.0])
    found = parabola_at([(time, np.array([value])) for time, value in zip(times, noise, strict=True)], 1.4)
    assert found == pytest.approx(np.polyval(np.polyfit(times, noise, 2), 1.4), rel=1e-12)
