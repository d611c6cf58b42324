"""Histories over time, and the steps that they cost."""

import math
from itertools import pairwise

import numpy as np
import pytest
from ngsolve import x

from ngswell import Adaptive, Blend, InputError, Potential, Ramp, Sine, Spline, rectangle
from tests.scenes import confined_column


def test_ramp_is_linear_between_its_points_and_constant_beyond():
    ramp = Ramp((7000, 4.1), (7080, 2.7), (7220, 0.3))
    assert [ramp.at(t) for t in (0, 7000, 7040, 7080, 1e6)] == pytest.approx([4.1, 4.1, 3.4, 2.7, 0.3])
    assert ramp.kinks == (7000, 7220)  # at 7080 s its slope hardly changes, from -0.0175 to -0.0171
    assert ramp.bends == (7080,)
    assert Ramp((0, 0.15)).kinks == ()


def straight(points):
    """A bath [mol/l] that falls evenly over 400 s, through so many points; their decimals are rounded."""
    return Ramp(*[(float(time), 0.15 - 0.025 * time / 400) for time in np.linspace(0, 400, points)])


def sampled(points):
    """`WAVE` through so many points a cycle."""
    return [(float(time), WAVE.at(time)) for time in np.linspace(0, 400, 2 * points + 1)]


WAVE = Sine(0.15, 0.02, 200.0, 2)


def test_points_on_a_line_are_no_kinks():
    for points in (3, 11, 97):
        assert (straight(points).kinks, straight(points).bends) == ((0, 400), ())
    assert Ramp((0, 1.0), (5, 1.0), (9, 1.0)).kinks == ()
    assert Ramp((0, 0.0), (5, 0.5 + 1e-6), (10, 1.0)).bends == (5,)  # the control: off the line by a millionth
    assert Ramp((0, 0.0), (5, 0.52), (10, 1.0)).kinks == (0, 5, 10)


def test_small_bends_are_no_kinks():
    ramp = Ramp(*sampled(96))
    assert len(ramp.bends) > 180
    assert set(ramp.kinks) == {0.0, 400.0}
    assert set(ramp.kinks).isdisjoint(ramp.bends)
    assert len(Ramp(*sampled(8)).kinks) == 17 - 3  # it is straight through the mean, but for the ends


def test_a_spline_stays_between_its_points_and_is_smooth():
    spline = Spline((0, 0.1), (10, 0.1), (12, 0.5), (20, 0.6), (30, 0.2), (50, 0.2))
    assert [spline.at(t) for t in (-5, 0, 10, 12, 20, 30, 60)] == pytest.approx(
        [0.1, 0.1, 0.1, 0.5, 0.6, 0.2, 0.2], abs=1e-15
    )
    assert (spline.kinks, spline.bends) == ((10, 30), (20,))
    for (start, first), (end, last) in pairwise(zip(spline.times, spline.values, strict=True)):
        low, high = sorted((first, last))
        inside = [spline.at(t) for t in np.linspace(start, end, 50)]
        assert low - 1e-15 <= min(inside) <= max(inside) <= high + 1e-15
    h = 1e-6
    for time in spline.times:  # one slope on both sides: what differs is of first order in h
        before, after = (spline.at(time) - spline.at(time - h)) / h, (spline.at(time + h) - spline.at(time)) / h
        assert before == pytest.approx(after, abs=1e-5)
    ramp = Ramp((10, 0.1), (12, 0.5))  # the control: its slope jumps by 0.2
    assert (ramp.at(10 + h) - ramp.at(10)) / h == pytest.approx(0.2, rel=1e-6)


def test_a_spline_of_two_points_rises_evenly_from_and_to_rest():
    spline = Spline((0, 1.0), (4, 3.0))
    assert [spline.at(t) for t in (1, 2, 3)] == pytest.approx([1 + 2 * (3 / 16 - 2 / 64), 2.0, 1 + 2 * (27 / 16 - 54 / 64)])
    assert Spline((3, 0.2)).at(7) == 0.2


def test_a_spline_through_a_sine_is_near_it():
    def error(points, times):
        spline = Spline(*sampled(points))
        return max(abs(spline.at(t) - WAVE.at(t)) for t in times) / 0.02

    # In the first and last piece it begins level, the sine with the slope 2π/T: off by s(1 − s)² of it, 4/27 at most.
    for points in (24, 96):
        assert error(points, np.linspace(0, 400, 3000)) == pytest.approx(4 / 27 * 2 * math.pi / points, rel=0.05)
    # Between, second order: near extremes the slope of a neighbour is a mean that leaves their curvature out.
    coarse, fine = (error(points, np.linspace(20, 380, 3000)) for points in (24, 96))
    assert coarse < 0.01
    assert fine < coarse / 12


def test_a_sine_has_whole_cycles():
    sine = Sine(0.2, -0.1, 8.0, 3, start=100.0)
    assert [sine.at(t) for t in (0, 100, 102, 106, 108, 123, 124, 1e6)] == pytest.approx(
        [0.2, 0.2, 0.1, 0.3, 0.2, 0.2 + 0.1 * math.sqrt(0.5), 0.2, 0.2], abs=1e-14
    )
    assert sine.kinks == (100.0, 124.0)
    assert sine.bends == (102.0, 106.0, 110.0, 114.0, 118.0, 122.0)
    assert sorted(sine.values) == pytest.approx([0.1, 0.2, 0.3])


def steps(history):
    """Steps and final displacement of the top [mm] of a column in this bath."""
    scene = confined_column(None, history, cells=12, model=Potential())
    result = scene.run(400.0, Adaptive(1e-3), unstable="off")
    return len(result.steps), result.state.at((0.5,), "displacement")


def test_steps_that_histories_cost():
    two, eleven = steps(straight(2)), steps(straight(11))
    assert eleven[0] == two[0]  # a kink each would be 41
    assert eleven[1] == pytest.approx(two[1], rel=1e-9)  # round-off of the points
    sine, smooth, linear = steps(WAVE), steps(Spline(*sampled(96))), steps(Ramp(*sampled(96)))
    assert sine[0] <= 30  # two cycles
    assert smooth[0] <= sine[0] + 2
    assert linear[0] <= 2 * 96 + 5  # one for each point; a kink each would be 4 times that
    # chords lie inside the arc by (2π/96)²/8 = 5e-4 of the amplitude, which moves the top by some 1e-2 mm
    assert sine[1] == pytest.approx(linear[1], abs=1e-5)
    assert sine[1] == pytest.approx(smooth[1], abs=1e-5)


def test_signal_follows_the_clock():
    mesh = rectangle(1, 1, 1, 1)
    first, second = Ramp((0, 1.0), (10, 2.0)), Ramp((0, 1.0), (20, 5.0))
    blend = Blend(first, second, x)
    signal = blend.signal()
    signal.set(10)
    assert signal.field(mesh(0.25, 0.5)) == pytest.approx(0.75 * 2 + 0.25 * 3)
    assert blend.kinks == (0, 10, 20)
    assert blend.at(0) == 1.0  # both agree: a number
    assert blend.at(10)(mesh(0.25, 0.5)) == pytest.approx(0.75 * 2 + 0.25 * 3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Ramp(), "at least one"),
        (lambda: Ramp((0, 1), (0, 2)), "increase"),
        (lambda: Ramp((0.0, 1.0), (2e-308, 2.0)), "increase, but 2e-308 s follows 0 s"),
        (lambda: Ramp((5, 1), (4, 2)), "4 s follows 5 s"),
        (lambda: Ramp((0, math.inf)), "finite"),
        (lambda: Ramp(5), "point has to be some numbers.*got 5"),
        (lambda: Ramp((0, 1, 2)), r"takes points \(time, value\)"),
        (lambda: Ramp(("0", "1")), "component '0'"),
        (lambda: Ramp([(0, 1), (1, 2)]), r"component \(0, 1\)"),
        (lambda: Spline(), "at least one"),
        (lambda: Spline((0, 1), (0, 2)), "Spline times have to increase"),
        (lambda: Sine(0.1, math.nan, 10.0, 1), "amplitude = nan is not finite"),
        (lambda: Sine(0.1, 0.1, 0.0, 1), "period has to be positive"),
        (lambda: Sine(0.1, 0.1, 10.0, 0), "cycles 0 is not a whole number from 1"),
        (lambda: Sine(0.1, 0.1, 10.0, 2.5), "cycles 2.5 is not a whole number"),
        (lambda: Sine(0.1, 0.1, 1e-9, 2, start=1e9), "lost in round-off"),
        (lambda: Blend(0.1, 0.2, x), "has to be a Ramp.*got 0.1"),
        (lambda: Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), 2.0), "weight = 2 is outside 0 … 1"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
