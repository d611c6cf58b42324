"""Donnan equilibrium: the numbers of the paper, the laws behind it, and every kind of argument."""

import numpy as np
import pytest
from ngsolve import CF, x

from ngswell import TABLE_1, rectangle
from ngswell.physics import donnan

ROUND_OFF = 1e-14


def test_initial_state_of_table_1():
    # Worked out by hand from (23): sqrt(0.0225 + 0.01) = 0.1802776.
    assert donnan.cations(0.15, 0.2) == pytest.approx(0.28027756, rel=1e-7)
    assert donnan.pressure(0.15, 0.2, TABLE_1.RT) == pytest.approx(0.150037, rel=1e-5)


@pytest.mark.parametrize("bath", [1e-9, 1e-4, 0.15, 5.0])
@pytest.mark.parametrize("cfc", [0.0, 1e-3, 0.2, 2.0])
def test_ion_product_and_electroneutrality(bath, cfc):
    plus, minus = donnan.cations(bath, cfc), donnan.anions(bath, cfc)
    assert plus * minus == pytest.approx(bath**2, rel=ROUND_OFF)
    assert plus - minus == pytest.approx(cfc, rel=ROUND_OFF, abs=ROUND_OFF * bath)
    # (23)₂ and (38) are the same pressure.
    osmotic = TABLE_1.RT * (plus + minus - 2 * bath)
    assert donnan.pressure(bath, cfc, TABLE_1.RT, 0.3) == pytest.approx(0.3 + osmotic, rel=1e-12)


def test_floats_arrays_and_fields_agree():
    charge = np.array([0.0, 0.1, 0.7])
    expected = [donnan.cations(0.3, c) for c in charge]
    assert donnan.cations(0.3, charge) == pytest.approx(expected, rel=ROUND_OFF)
    mesh = rectangle(1, 1, 1, 1)
    field = donnan.cations(CF(0.3), 0.7 * x)
    assert field(mesh(1.0, 0.5)) == pytest.approx(expected[-1], rel=ROUND_OFF)


def test_the_printed_condition_is_another_one():
    # (32) as printed, with ¼ and ½ swapped, breaks the ion product.
    printed = (0.15**2 + 0.2**2 / 2) ** 0.5 + 0.2 / 4
    assert abs(printed * (printed - 0.2) / 0.15**2 - 1) > 0.1
