"""The study of all treatments at its quick size."""

import pytest

from studies.choices.treatments import CHOICES, QUICK_DECADES, key
from tests.studies.quick import quick


def test_treatments(tmp_path):
    numbers, rows = quick("treatments", tmp_path)
    header = rows[0]
    table = [dict(zip(header, row, strict=True)) for row in rows[1:]]

    # Only the charge of the last step at the node itself grows on the strip; the penalty-free form has no room to.
    assert numbers["strip_lagged_growth"] == pytest.approx(3.1347, rel=1e-3)
    assert all(numbers[f"strip_{key(name)}_growth"] < 1 for name in CHOICES if name != "lagged")

    # What is prescribed, or held by multipliers, is met to the accuracy of the nonlinear solve; a penalty leaves flux/ε.
    for scene in ("column", "strip"):
        assert numbers[f"{scene}_potential_essential_condition"] < 1e-12
        assert numbers[f"{scene}_multiplier_condition"] < 1e-10
        weak = {
            float(r["value"]): float(r["condition"])
            for r in table
            if (r["scene"], r["treatment"], r["mesh"]) == (scene, "penalty", "8" if scene == "column" else "1 x 8")
        }
        small, large = QUICK_DECADES
        assert 1e-10 < weak[large] < 1e-3 < weak[small]
        # The charge of the last step is one step late, that of the start wrong for good.
        best = numbers[f"{scene}_potential_essential_error"]
        assert numbers[f"{scene}_lagged_error"] > 3 * best
        assert numbers[f"{scene}_frozen_error"] > 1
        # One mesh, one plateau: whatever imposes the condition well has the error of the mesh.
        for name in ("penalty", "nitsche", "nitsche_skew", "potential_penalty"):
            assert numbers[f"{scene}_{name}_plateau"] == pytest.approx(best, rel=0.1)
        assert numbers[f"{scene}_reference_error"] < 1e-2 * best

    # The block: penalties never fail, nor Nitsche's method with a γ that it takes, but for the skew form with little.
    for name in ("penalty", "nitsche", "nitsche_without_adjoint", "potential_penalty", "multiplier", "potential_essential"):
        assert numbers[f"block_{name}_failures"] == 0
    failing = [r for r in table if r["scene"] == "block" and r["outcome"] != "passes"]
    assert {r["treatment"] for r in failing} == {"nitsche skew", "nitsche skew without penalty"}
    assert all(r["value"] in ("", f"{QUICK_DECADES[0]:.10g}") for r in failing)
