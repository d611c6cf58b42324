"""Baths and treatments: what is refused, and which stand beside each other."""

import math

import numpy as np
import pytest
from ngsolve import CF

from ngswell import Bath, Blend, Fixed, Frozen, InputError, Lagged, Multiplier, Nitsche, Penalty, Ramp
from tests.scenes import strip


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Bath("top", c=0.0), "= 0 mol/l is outside 1e-12 … 10: for pure water"),
        (lambda: Bath("top", c=-0.15), "-0.15"),
        (lambda: Bath("top", c=150.0), "mol/m³"),
        (lambda: Bath("top", c=Ramp((0, 0.1), (1, -0.1))), "-0.1"),
        (lambda: Bath("top", c=Blend(Ramp((0, 0.1)), Ramp((0, -0.1)), CF(0.5))), "-0.1"),
        (lambda: Bath("top", c=0.15, P=1e6), "1e6 Pa"),
        (lambda: Bath("top", c=0.15, treatment="weak"), "Penalty"),
        (lambda: Penalty(), "relative"),
        (lambda: Penalty(1.0, relative=1.0), "either"),
        (lambda: Penalty(-1.0), "positive"),
        (lambda: Penalty(relative=0.0), "positive"),
        (lambda: Penalty(math.nan), "positive"),
        (lambda: Penalty(0.0), "positive and finite, got 0.0"),
        (lambda: Penalty(relative=-1e3), "positive and finite, got -1000.0"),
        (lambda: Penalty("40"), "positive and finite, got .40."),
        (lambda: Nitsche("20"), "gamma has to be at least 20 and finite, got .20."),
        (lambda: Nitsche(19.9), "adjoint 'symmetric': gamma has to be at least 20 and finite, got 19.9"),
        (lambda: Nitsche(4.9, "none"), "adjoint 'none': gamma has to be at least 5"),
        (lambda: Nitsche(-1.0, "skew"), "adjoint 'skew': gamma has to be at least 0 and finite, got -1.0"),
        (lambda: Nitsche(math.inf), "finite, got inf"),
        (lambda: Nitsche(math.nan), "finite, got nan"),
        (lambda: Nitsche(adjoint="antisymmetric"), "'antisymmetric' is none of 'symmetric', 'skew', 'none'"),
        (lambda: Bath("top", c=0.15, treatment=Nitsche), r"has to be Penalty\(...\), Nitsche\(\).*got the class Nitsche"),
        (lambda: Bath("top", c="0.1"), "concentration.*number, got '0.1'"),
        (lambda: Bath("top", c=True), "got True"),
        (lambda: Bath("top", c=1e-300), "1e-300 mol/l is outside"),
        (lambda: Bath(3, c=0.1), "boundary has to be a name.*got 3"),
        (lambda: Penalty(10**400), "positive and finite, got 1000"),
        (lambda: Nitsche(adjoint=np.array([1, 2])), "is none of 'symmetric'"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize("other", [Lagged(), Frozen(), Penalty(1.0), Nitsche(), Multiplier()])
def test_multipliers_stand_beside_baths_that_they_do_not_touch(other):
    baths = [Bath("top", c=0.15, treatment=Multiplier()), Bath("bottom", c=0.15, treatment=other)]
    assert strip(baths=baths, cells=(1, 3)).run(2.0, Fixed(1.0)).rejections == 0


@pytest.mark.parametrize("other", [Penalty(1.0), Nitsche(), Multiplier()])
def test_multipliers_stand_beside_weak_baths_that_they_touch(other):
    baths = [Bath("top", c=0.15, treatment=Multiplier()), Bath("left", c=0.15, treatment=other)]
    scene = strip(baths=baths, cells=(2, 3))
    assert scene.run(2.0, Fixed(1.0)).rejections == 0


def test_multipliers_beside_prescribed_values_would_be_singular(monkeypatch):
    # Control: what is refused cannot be solved.
    monkeypatch.setattr(Multiplier, "check_in", lambda *arguments: None)
    baths = [Bath("top", c=0.15, treatment=Multiplier()), Bath("left", c=0.15, treatment=Lagged())]
    problem = strip(baths=baths, cells=(2, 3)).problem
    problem.initialise()
    rows, columns, values = problem.linearise().COO()
    matrix = np.zeros((problem.vector.size,) * 2)
    matrix[np.array(rows), np.array(columns)] = values
    free = np.flatnonzero(list(problem.free))
    sizes = np.linalg.svd(matrix[np.ix_(free, free)], compute_uv=False)
    # One multiplier of each balance too many, for the corner they share.
    assert sizes[-2] < 1e-15 * sizes[0] < 1e-3 * sizes[-3]
