"""Materials out of range are refused, also where they vary in space or their laws fail."""

import math

import numpy as np
import pytest
from ngsolve import CF, x

from ngswell import InputError, Material
from tests.scenes import NUMBERS, strip


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mu", 0.0), ("mu", -1.0), ("mu", 2.4e5), ("lam", -0.1), ("nS0", 0.0), ("nS0", 1.0), ("nS0", 1.2), ("cfc0", -0.1),
        ("cfc0", 200.0), ("D_plus", 0.0), ("D_minus", -1e-4), ("D_plus", 2e-9), ("D_minus", 2e-9),
        ("K", 0.0), ("K", 1e-15), ("theta", 25.0),
        ("mu", math.nan), ("mu", "0.24"), ("mu", True), ("theta", CF(298.0)), ("mu", CF((1.0, 2.0))),
    ],
)  # fmt: skip
def test_material_out_of_range(name, value):
    with pytest.raises(InputError, match=name):
        Material(**{**NUMBERS, name: value})


def test_material_field_out_of_range_is_found_on_the_mesh():
    with pytest.raises(InputError, match="nS0"):
        strip(material=Material(**{**NUMBERS, "nS0": 0.25 + 2 * x / 0.02}))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Material(**{**NUMBERS, "mu": 10**400}), "mu = inf"),
        (lambda: Material(**{**NUMBERS, "mu": CF(1j)}), "mu has to be scalar and real"),
        (lambda: Material(**{**NUMBERS, "nS0": 5e-324}), "nS0 = 5e-324"),
        (lambda: Material(**NUMBERS, permeability=lambda K, J, nS0: K * math.nan), "permeability .* gives K = nan"),
        (lambda: Material(**NUMBERS, diffusivity=lambda D, nF: -D), "diffusivity .* gives D = -1"),
        (
            lambda: Material(**NUMBERS, permeability=lambda K, J, nS0: K * np.exp(J - 1)),
            "permeability .* and of fields",
        ),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
