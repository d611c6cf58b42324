"""The study of the reduced models at its quick size."""

import pytest

from ngswell import TABLE_1
from studies.choices.reductions import BATHS, CHARGED, CHARGES, LOADS, MODELS, RATIOS, H
from tests.studies.quick import quick


def test_reductions(tmp_path):
    numbers, rows = quick("reductions", tmp_path)
    error = {key.replace("_error", ""): value for key, value in numbers.items() if "_error_" in key}
    assert all(value >= 0 for value in error.values())

    # Fast ions: first order in H K / D, for loads and for a bath that changes slowly against diffusion. The largest error
    # lies near the diffusion time, where the smaller decade is not quite asymptotic.
    assert numbers["local_donnan_order_bath_ramp"] == pytest.approx(1, abs=0.05)
    assert numbers["local_donnan_order_load"] == pytest.approx(1, abs=0.1)
    for kind in ("load", "bath_step", "bath_ramp"):
        local = [error[f"local_donnan_{kind}_{ratio:g}"] for ratio in RATIOS]
        assert local == sorted(local)  # slower ions, larger error
    # Loads move little salt: LocalDonnan answers them whatever the ratio, and the gap to bath steps is wide.
    assert error["local_donnan_load_100"] < 0.01
    assert error["local_donnan_bath_step_1"] > 20 * error["local_donnan_load_1"]
    # A slow change of the bath is easier than a sudden one.
    assert all(error[f"local_donnan_bath_ramp_{r:g}"] <= error[f"local_donnan_bath_step_{r:g}"] for r in RATIOS)

    # Uncharged: nothing moves when the bath changes, so the error is the full model's own displacement.
    assert all(error[f"uncharged_bath_step_{ratio:g}"] == pytest.approx(1, abs=1e-3) for ratio in RATIOS)
    # Under a small load the final displacements differ by the osmotic stiffness over H: 0.367/0.5 in closed form. At the
    # smallest load, 1 % of H, strains change that by about as much.
    osmotic = TABLE_1.RT * 0.2**2 / (2 * (0.15**2 + 0.01) ** 0.5 * 0.75)
    assert error["uncharged_load_0.01_H"] == pytest.approx(osmotic / H, rel=0.02)
    # Effective parameters are LocalDonnan's for small strains: the rest grows with the load.
    assert error["effective_load_0.01_H"] < error["effective_load_0.1_H"] < error["effective_load_0.4_H"] < 0.1
    # Less charge, less to leave out.
    without = [error[f"uncharged_load_cfc0_{charge:g}"] for charge in CHARGES]
    assert without == sorted(without)
    assert without[0] < 0.02

    # Discretisation does not decide any of this: the errors compare models on one mesh with the same steps.
    assert abs(numbers["mesh_change"]) < 0.01
    assert abs(numbers["step_change"]) < 0.1

    # Costs: c and the charge field are left out; seconds depend on who else computes, so they are not tested.
    for name in ("local_donnan", "uncharged"):
        assert numbers["full_column_unknowns"] - numbers[f"{name}_column_unknowns"] == 2 * (20 + 1)
        assert numbers[f"{name}_block_unknowns_ratio"] < 1
    cases = {row[0] for row in rows[1:]}
    assert len(cases) == 3 * len(RATIOS) + 2 * len(CHARGES) + len(LOADS) + len(BATHS)
    assert {row[2] for row in rows[1:]} == set(MODELS) >= set(CHARGED)
