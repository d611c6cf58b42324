"""Supports and loads: what is refused."""

import math

import numpy as np
import pytest

from ngswell import InputError, Pin, Roller, Symmetry, Traction, Weight
from tests.scenes import confined_column, strip


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Traction("top", (0.0, math.nan)), "finite"),
        (lambda: Weight((0.0, -9.81), (0.0, 0.0)), "N/mm³"),
        (lambda: Roller("bottom", ""), "direction has to be a name.*got ''"),
        (lambda: Traction("top", 1.0), "some numbers.*got 1.0"),
        (lambda: Traction("top", ("a", 0.0)), "component 'a'"),
        (lambda: Weight(np.array([0.0, -9.0]), np.array([0.0, 9.0])), "fluid has a component"),
        (lambda: Pin("ab", "x"), "point.*got 'ab'"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_symmetry_needs_a_straight_boundary():
    with pytest.raises(InputError, match="not straight"):
        strip(supports=[Symmetry("left|bottom")])


def test_a_generator_of_supports_is_kept():
    # It used to be empty after the first look, so that the body seemed free.
    scene = confined_column(cells=2, supports=(support for support in [Roller("bottom", "x")]))
    assert scene.fixed() == {"x": "bottom"}
