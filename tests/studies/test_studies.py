"""Each study at its quick size, through the command line; its numbers with reasons."""

import matplotlib.pyplot as plt
import pytest

from studies.__main__ import STUDIES, main
from studies.output import letter_panels
from tests.studies.quick import quick


def test_boundary_charge(tmp_path):
    numbers, rows = quick("boundary_charge", tmp_path)
    # The homogeneous end state lies in the discrete space: what is left is the relaxation, of which large last steps of
    # backward Euler remove only a factor 1/(1 + Δt/τ) each.
    assert numbers["following_final_mm"] == pytest.approx(numbers["closed_form_following_mm"], rel=1e-5)
    assert numbers["frozen_final_mm"] == pytest.approx(numbers["closed_form_frozen_mm"], rel=1e-5)
    assert numbers["following_final_mm"] == pytest.approx(0.01341, rel=2e-3)
    assert numbers["frozen_final_mm"] == pytest.approx(0.02439, rel=2e-3)
    assert {row[0] for row in rows[1:]} == {"following", "frozen"}


def test_oscillation(tmp_path):
    numbers, rows = quick("oscillation", tmp_path)
    assert numbers["lagged_growth_per_step"] < -2
    for key in [k for k in numbers if k.endswith("_predicted")]:
        measured = numbers["lagged_growth_per_step" if key == "lagged_growth_predicted" else key.removesuffix("_predicted")]
        # Some ten clean steps between round-off and the first effect of nonlinearity.
        assert measured == pytest.approx(numbers[key], rel=5e-3)
    growth = [numbers[f"lagged_growth_at_{dt}_s"] for dt in ("0.1", "1", "10", "100")]
    assert all(g < -2.5 for g in growth)  # three decades of time steps, no cure
    assert 15 < numbers["lagged_visible_step"] < 40  # ln(1e-6/1e-17) / ln 3 and the time to find the mode
    assert numbers["lagged_max_mm"] > 1e-5
    assert numbers["weak_max_mm"] < 1e-12
    assert numbers["column_factor"] == pytest.approx(-0.733, abs=5e-4)
    # The factor is a property of the mesh: finer cells along or across, faster growth.
    assert numbers["lagged_growth_predicted_1x30"] == pytest.approx(numbers["lagged_growth_predicted"], rel=1e-5)
    for finer in (("1x15", "1x30", "1x60"), ("1x30", "2x30", "4x30")):
        factors = [numbers[f"lagged_growth_predicted_{mesh}"] for mesh in finer]
        assert factors == sorted(factors, reverse=True)
    assert {row[0] for row in rows[1:]} == {"lagged", "weak"}


def test_free_swelling(tmp_path):
    numbers, _ = quick("free_swelling", tmp_path)
    # 7000 s leave some e^(-7) of the relaxation of the core; the figures' size of the study is held to 0.1 %.
    for key in ("initial_J", "initial_cfc", "initial_nS"):
        assert numbers[key] == pytest.approx(numbers[f"closed_form_{key}"], rel=2e-3)
    assert numbers["closed_form_area_ratio_equilibrium"] == pytest.approx(2.164, abs=1e-3)
    assert numbers["area_ratio_equilibrium"] == pytest.approx(numbers["closed_form_area_ratio_equilibrium"], rel=2e-3)
    # Negative osmosis: the core shrinks while the corner swells to the final J and beyond.
    assert numbers["core_J_min"] < numbers["core_J_initial"] - 0.2
    assert numbers["corner_J_at_core_min"] > 2.5
    assert 7220 < numbers["core_J_min_time_s"] < 8000
    # Transient numbers within their own error estimates (doubled) of the full study's: 0.940, 1.950 and 1.092.
    for key, value in (("area_ratio_7220", 0.940), ("area_ratio_11000", 1.950), ("core_J_min", 1.092)):
        errors = abs(numbers[f"{key}_mesh_error"]) + abs(numbers[f"{key}_step_error"])
        assert abs(numbers[key] - value) < 2 * errors + 1e-3
        assert errors < 0.03
    assert numbers["fluid_imbalance"] < 1e-10
    assert numbers["cation_imbalance"] < 1e-10


def test_cylinder(tmp_path):
    numbers, _ = quick("cylinder", tmp_path)
    for body in ("disc", "block"):
        # Homogeneous states lie in every space: Newton's tolerance, and what is left of the relaxation at 1e6 s.
        assert numbers[f"{body}_initial_J"] == pytest.approx(numbers["closed_form_initial_J"], rel=1e-9)
        closed = numbers["closed_form_volume_ratio_equilibrium"]
        assert numbers[f"{body}_volume_ratio_equilibrium"] == pytest.approx(closed, rel=1e-6)
        assert numbers[f"{body}_core_J_min"] < numbers[f"{body}_initial_J"] - 0.2  # negative osmosis
        assert numbers[f"{body}_fluid_imbalance"] < 1e-10
    assert numbers["disc_equilibrate_error"] < 1e-9
    # All faces at once: the block is ahead of the disc, whose bottom waits.
    assert numbers["block_volume_ratio_11000"] > numbers["disc_volume_ratio_11000"] > 2


def test_verification(tmp_path):
    numbers, _ = quick("verification", tmp_path)
    assert numbers["homogeneous_error"] < 1e-8  # Newton's tolerance
    assert numbers["terzaghi_error"] < 1e-4  # Δt³ of the extrapolation
    assert numbers["cryer_error"] < 1e-3
    assert numbers["cryer_overshoot"] == pytest.approx(numbers["cryer_overshoot_series"], abs=1e-3)
    assert numbers["linear_column_error"] < 2e-7  # the penalty's bias
    assert numbers["donnan_order_2"] == pytest.approx(2, abs=0.1)
    assert numbers["donnan_order_3"] == pytest.approx(3, abs=0.1)
    assert abs(numbers["donnan_printed_drive"]) < 0.1
    for key in (k for k in numbers if k.startswith("manufactured_")):
        order, name = int(key[-3]), key[-1]
        # Orders k + 1 of u and k of p and c; 0.25 on the coarse meshes in space (2 and 3 cells a side).
        assert numbers[key] > order + (name == "u") - (0.25 if "_3d_order_3" in key else 0.15), key


def test_output_is_refused_before_computing(tmp_path, capsys):
    (tmp_path / "oscillation.json").write_text("mine")
    assert main(["oscillation", "--quick", "--out", str(tmp_path)]) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert (tmp_path / "oscillation.json").read_text() == "mine"
    (tmp_path / "file").write_text("")
    assert main(["oscillation", "--out", str(tmp_path / "file" / "deeper")]) == 1
    assert "cannot be made" in capsys.readouterr().err


def test_an_option_of_another_study_is_refused(capsys, tmp_path):
    script = tmp_path / "plain.py"
    script.write_text("")
    for arguments, owner in ((["--from-rest"], "free_swelling"), (["--plain", str(script)], "speed_error")):
        for name in ([], ["oscillation"]):
            with pytest.raises(SystemExit):
                main([*name, *arguments])
            assert f"{arguments[0]} goes with {owner}" in capsys.readouterr().err


def test_every_panel_has_a_letter():
    _, axes = plt.subplots(1, 2)
    axes[0].set_title("area")
    letter_panels(axes)
    assert [ax.get_title("left") for ax in axes] == ["(a) area", "(b)"]
    assert not any(ax.get_title() for ax in axes)
    plt.close("all")


def test_an_unknown_study_lists_the_known_ones(capsys):
    with pytest.raises(SystemExit):
        main(["swelling"])
    message = capsys.readouterr().err
    assert all(name in message for name in STUDIES)
