"""Histories over time."""

import math

import pytest
from ngsolve import x

from ngswell import Blend, InputError, Ramp, rectangle


def test_ramp_is_linear_between_its_points_and_constant_beyond():
    ramp = Ramp((7000, 4.1), (7080, 2.7), (7220, 0.3))
    assert [ramp.at(t) for t in (0, 7000, 7040, 7080, 1e6)] == pytest.approx([4.1, 4.1, 3.4, 2.7, 0.3])
    assert ramp.kinks == (7000, 7080, 7220)
    assert Ramp((0, 0.15)).kinks == ()


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
        (lambda: Ramp((5, 1), (4, 2)), "4 s follows 5 s"),
        (lambda: Ramp((0, math.inf)), "finite"),
        (lambda: Ramp(5), "point has to be some numbers.*got 5"),
        (lambda: Ramp((0, 1, 2)), r"takes points \(time, value\)"),
        (lambda: Ramp(("0", "1")), "component '0'"),
        (lambda: Ramp([(0, 1), (1, 2)]), r"component \(0, 1\)"),
        (lambda: Blend(0.1, 0.2, x), "has to be a Ramp.*got 0.1"),
        (lambda: Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), 2.0), "weight = 2 is outside 0 … 1"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
