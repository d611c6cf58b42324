"""The closed forms of homogeneous swelling: what is refused."""

import math

import pytest
from ngsolve import x

from ngswell import TABLE_1, InputError, Material
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import NUMBERS


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: homogeneous_equilibrium(TABLE_1, math.nan, "3-d"), "salt = nan"),
        (lambda: homogeneous_equilibrium(TABLE_1, 0.15, "3-d", load=math.inf), "load = inf"),
        (lambda: homogeneous_equilibrium(TABLE_1, 0.1, "2-d"), "plane strain"),
        (lambda: homogeneous_equilibrium(Material(**{**NUMBERS, "cfc0": 0.1 + 0 * x}), 0.1, "3-d"), "varies in space"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
