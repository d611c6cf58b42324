"""The disc in a beaker ends where it and the water hold together what they held."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from examples import beaker
from ngswell import TABLE_1
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium

DISC = pi * 2.0**2 * 1.0  # mm³
nS0 = TABLE_1.number("nS0")


def held(volume, salt):
    """Salt of disc and water [mol/l mm³] in a homogeneous state of rest."""
    rest = homogeneous_equilibrium(TABLE_1, salt, "3-d")
    return DISC * (rest.J - nS0) * rest.c + volume(rest.J) * salt, rest.J


def test_it_fits_one_screen():
    assert len(Path(beaker.__file__).read_text(encoding="utf-8").splitlines()) <= 40


def test_the_disc_ends_with_the_salt_that_it_brought():
    in_bath, swollen = held(lambda J: 0.0, 0.15)
    wanted = in_bath + 20.0 * 1e-3
    low, high = 1e-3, 0.15
    for _ in range(60):
        salt = (low + high) / 2
        found, J = held(lambda J: 20.0 - DISC * (J - swollen), salt)
        low, high = (low, salt) if found > wanted else (salt, high)
    time, c, fluid = beaker.course()
    assert time[-1] == 18000.0
    assert c[-1] == pytest.approx(salt, rel=1e-5)  # e^-9 of the slowest decay, 0.5 h, and the solves of Adaptive
    assert fluid[-1] == pytest.approx(DISC * (J - nS0), rel=1e-5)
    assert fluid[0] == pytest.approx(DISC * (swollen - nS0), rel=1e-9)
    assert np.all(np.diff(c[time > 1.0]) > 0)  # salt leaves the gel; in milliseconds it does not cross a cell
    assert homogeneous_equilibrium(TABLE_1, 1e-3, "3-d").J > 1.1 * J  # control: in much of this water it swells by far more
