"""The study of lagged baths at its quick size."""

import math

import pytest

from ngswell import TABLE_1
from ngswell.closed_forms.homogeneous import lagged_column_factor
from ngswell.physics import donnan
from studies.choices.stability import BATH, CHARGES, RANGE, SOFT, TREATMENTS, column_safe_stiffness, material
from tests.studies.quick import quick

# Three points on the µ axis, two bisections: a bound is the middle of an interval of this ratio to either side.
RESOLUTION = (RANGE[1] / RANGE[0]) ** (1 / 2 / 8)


def close(found, wanted):
    return 1 / RESOLUTION <= found / wanted <= RESOLUTION


def test_column_safe_stiffness():
    for cfc0 in CHARGES:
        assert lagged_column_factor(material(column_safe_stiffness(cfc0), cfc0), BATH) == pytest.approx(-1, rel=1e-14)


def test_stability(tmp_path):
    numbers, rows = quick("stability", tmp_path)
    middle, most = (CHARGES[0] * CHARGES[1]) ** 0.5, CHARGES[1]

    # From the mode itself: the rest state and the onset of nonlinearity, 1e-7 mm of 0.5 mm, leave some 1e-5.
    for key in [k for k in numbers if k.endswith("_predicted")]:
        assert numbers[key.replace("_predicted", "_measured")] == pytest.approx(numbers[key], rel=1e-4), key

    for cfc0 in (middle, most):
        safe = {key: numbers[f"strip_{key}_safe_mu_at_{cfc0:g}"] for key in TREATMENTS}
        column = column_safe_stiffness(cfc0)
        # One cell across: mean and constant fit leave the column's mode alone; without them the lateral one decides.
        assert close(safe["averaged"], column)
        assert close(safe["least_squares"], column)
        assert safe["lagged"] > RESOLUTION * column
        assert safe["inner_layer"] <= safe["averaged"]
        assert safe["frozen"] == RANGE[0]  # it has nothing that lags
        # The block without remedy is hardly better than a column; every remedy helps.
        block = {key: numbers[f"block_{key}_safe_mu_at_{cfc0:g}"] for key in TREATMENTS}
        assert close(block["lagged"], column)
        assert block["inner_layer"] <= block["least_squares"] <= block["averaged"] < block["lagged"]
        # With the charge of the start no state at rest for µ < p_D(cfc0), apart from the little that λ carries.
        assert close(block["frozen"], donnan.pressure(BATH, cfc0, TABLE_1.RT))
    without = [row for row in rows[1:] if row[4] == "nan"]
    assert without
    assert {(row[0], row[1]) for row in without} == {("block", "frozen")}

    # A finer mesh: averaging reaches one cell, so it loses its effect; the constant fit and the inner layer keep theirs.
    assert abs(numbers["strip_averaged_growth_1_across"]) < 1 < -numbers["strip_averaged_growth_2_across"]
    assert numbers["strip_lagged_growth_2_across"] < numbers["strip_lagged_growth_1_across"] < -3
    for key in ("inner_layer", "least_squares", "frozen"):
        assert abs(numbers[f"strip_{key}_growth_2_across"]) < 1
    # Degree 2 has every mode that a strip of one or two cells has.
    for across in (1, 2):
        lagged = numbers[f"strip_lagged_growth_{across}_across"]
        assert numbers[f"strip_least_squares_2_growth_{across}_across"] == pytest.approx(lagged, rel=1e-3)

    # The column's mode knows no time step; the inner layer helps only as long as a step does not reach through it.
    factor = lagged_column_factor(material(SOFT), BATH)
    for key in ("lagged", "averaged", "least_squares"):
        for dt in (1, 100):
            assert numbers[f"strip_{key}_growth_at_{dt}_s"] == pytest.approx(factor, rel=1e-3)
    assert 0 < numbers["strip_inner_layer_growth_at_1_s"] < 1
    assert factor < numbers["strip_inner_layer_growth_at_100_s"] < -1

    assert all(0 < numbers[f"{body}_{key}_safe_share"] <= 1 for body in ("strip", "block") for key in TREATMENTS)
    assert all(math.isfinite(float(row[5])) for row in rows[1:])
    assert len(rows) - 1 == 2 * len(TREATMENTS) * 9
