"""Materials out of range are refused, also where they vary in space or their laws fail."""

import math
from dataclasses import replace

import numpy as np
import pytest
from ngsolve import CF, x

from ngswell import (
    Bath,
    Concentration,
    Fixed,
    InputError,
    LocalDonnan,
    Material,
    Penalty,
    Potential,
    Traction,
    Uncharged,
)
from tests.scenes import NUMBERS, UNCHARGED, confined_column, strip


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


def without(*names, **changes):
    return Material(**{name: value for name, value in {**NUMBERS, **changes}.items() if name not in names})


def test_a_material_without_ions():
    drained = without("cfc0", "D_plus", "D_minus")
    assert (drained.cfc0, drained.D_plus, drained.D_minus) == (0.0, None, None)
    assert drained == without("D_plus", "D_minus", cfc0=0.0)
    column = {"material": drained, "loads": []}
    for model in (Potential(), Concentration(), LocalDonnan()):
        with pytest.raises(InputError, match=rf"{type(model).__name__}: the material has no ions: .* Uncharged\(\)"):
            confined_column(None, model=model, **column)
    for treatment in (None, Penalty(relative=1e4)):
        load = [Traction("top", (-0.01,))]
        runs = [
            confined_column(model=Uncharged(), material=material, loads=load, baths=[Bath("top", treatment=treatment)])
            .run(100.0, Fixed(50.0))
            .end.values
            for material in (drained, UNCHARGED)
        ]
        assert np.array_equal(*runs)  # the ions' parameters enter nowhere


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: without("cfc0"), "cfc0 is missing beside D_plus and D_minus"),
        (lambda: without("D_plus"), r"D_plus \[mm²/s\] missing"),
        (lambda: without("D_plus", "D_minus"), r"D_plus and D_minus \[mm²/s\] missing"),
        (lambda: without("cfc0", "D_minus"), "cfc0 is missing"),
        (lambda: without("D_plus", "D_minus", cfc0=0.1 + x), "D_plus and D_minus"),
        (lambda: without("D_minus", cfc0=0.0), "D_minus"),
        (lambda: replace(without("cfc0", "D_plus", "D_minus"), cfc0=0.2), "D_plus and D_minus"),
        (lambda: without("cfc0", "D_plus", "D_minus").number("D_plus"), "the material has no ions"),
    ],
)
def test_ions_come_with_all_their_parameters(make, words):
    with pytest.raises(InputError, match=words):
        make()


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
