"""Experiments of the laboratory, each in a file of at most 40 lines, against a number of its own."""

from pathlib import Path

import numpy as np
import pytest

from examples import confined_compression, oedometer, unconfined_compression
from ngswell import Reaction
from ngswell.physics import donnan

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ["confined_compression", "oedometer", "unconfined_compression"]


@pytest.mark.parametrize("name", NAMES)
def test_it_fits_one_screen(name):
    assert len((EXAMPLES / f"{name}.py").read_text(encoding="utf-8").splitlines()) <= 40


@pytest.mark.parametrize("salt", [1.0, 0.1, 0.01])
def test_oedometer(salt):
    gel = oedometer.gel
    assert oedometer.swelling_pressure(salt) == pytest.approx(donnan.pressure(salt, gel.cfc0, gel.RT), rel=1e-9)  # Newton's
    assert oedometer.swelling_pressure(salt, -1.0) > 1.2 * oedometer.swelling_pressure(salt)  # control: another height


def relaxed(strain):
    """Stress of the layered column at rest: at each depth J is such that Donnan's pressure less the solid's is that."""
    x, weights = (np.polynomial.legendre.leggauss(30)[0] + 1) / 2, np.polynomial.legendre.leggauss(30)[1] / 2
    nS0, cfc0, RT = 0.28 - 0.08 * x, 0.25 - 0.15 * x, 8.3144e-3 * 298
    mu, lam = 0.3, 0.1

    def pressure(J):
        solid = (mu * (J**2 - 1) + lam * (1 - nS0) ** 2 * (J / (1 - nS0) - J / (J - nS0))) / J
        return donnan.pressure(0.15, (1 - nS0) * cfc0 / (J - nS0), RT) - solid

    def bisect(falls, low, high):
        for _ in range(60):
            middle = (low + high) / 2
            above = falls(middle) > 0
            low, high = np.where(above, middle, low), np.where(above, high, middle)
        return low

    def height(stress):
        return (weights * bisect(lambda J: pressure(J) - stress, np.full(30, 0.4), np.full(30, 4.0))).sum()

    return bisect(lambda stress: height(stress) - (1 - strain), 0.0, 5.0)


def test_confined_compression():
    found = confined_compression.stresses()
    exact = [float(relaxed(0.02 * step)) for step in (1, 2, 3, 4)]
    # Budget: 5000 s of relaxation leave 1e-6, 20 cells 1e-8.
    assert found[:, 1] == pytest.approx(exact, rel=1e-5)
    # 60 cells of order 3 and steps with a tolerance of 1e-5 have 0.2305 N/mm².
    assert found[0, 0] == pytest.approx(0.2305, abs=3e-4)


def test_unconfined_compression():
    force, rest = Reaction("top", when=[0.0, 60.0, 1800.0]), Reaction("top")
    unconfined_compression.test.run(1800, observers=[force])
    unconfined_compression.test.equilibrate(1800, observers=[rest])
    assert force.values[0, 1] == pytest.approx(0.1, abs=1e-9)  # the tare load, in balance
    # 20 × 12 cells of order 3 have 2.536, 1.274 and 1.273 N: fibres bear the bulge, so the fluid bears more at first.
    assert [*force.values[1:, 1], rest.values[0, 1]] == pytest.approx([2.536, 1.274, 1.273], rel=2e-3)
