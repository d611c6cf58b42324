"""The studies of speed and of errors in time, at their quick size."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ngswell.stepping import sizes
from ngswell.stepping.sizes import Sizes
from studies.__main__ import main
from studies.choices import speed_error
from studies.choices.iteration import PARTS, IterationCost
from studies.choices.random_runs import errors, random_run
from studies.choices.reference import Course, Reference
from studies.choices.speed_error import ComputedBlock, Curve, ratio, seconds_at
from tests.studies.quick import quick


def test_seconds_at_an_error():
    seconds, errors = [1.0, 4.0, 16.0, 20.0], [1e-2, 1e-3, 1e-4, 5e-4]  # the last point is beaten by the third
    assert seconds_at(1e-3, errors, seconds) == (pytest.approx(4.0), "measured")
    assert seconds_at(10**-3.5, errors, seconds) == (pytest.approx(8.0), "measured")  # half way, both logarithmic
    assert seconds_at(1e-5, errors, seconds) == (pytest.approx(64.0), "extrapolated")
    assert seconds_at(1e-1, errors, seconds) == (1.0, "at most")


def test_turns():
    """A point that fails is dropped and said, one beyond 10 s runs once, the others in every turn."""

    def block(seconds):
        return ComputedBlock(np.zeros(1), np.zeros(1), None, 1, [seconds])

    times = iter([1.0, 12.0, 3.0, 2.0])
    makers = [lambda: block(next(times)), lambda: None, lambda: block(next(times))]
    curve = Curve("dolfinx_euler_uniform", "", makers, [("2 x 2", 0.1), ("3 x 3", 0.1), ("4 x 4", 0.01)])
    for _ in range(3):
        curve.take_turn()
    assert curve.seconds == [2.0, 12.0]
    assert curve.failed == ["3 x 3, 0.1"]
    assert curve.settings == [("2 x 2", 0.1), ("4 x 4", 0.01)]
    assert curve.rival


def test_ratio_to_the_fastest_rival():
    at = {
        "potential_order_3_graded": {1e-3: (2.0, "measured")},
        "concentration_order_3_graded": {1e-3: (4.0, "measured")},
        "paper": {1e-3: (1.0, "measured")},
        "good_ngsolve_esdirk4_graded": {1e-3: (3.0, "at most")},
        "dolfinx_euler_uniform": {1e-3: (0.5, "extrapolated")},  # counts only where nothing is measured
    }
    found = ratio(1e-3, at, ["good_ngsolve_esdirk4_graded", "dolfinx_euler_uniform"], "")
    assert found["ratio_to_best_rival_at_1e-3"] == 1.5
    assert found["best_rival_at_1e-3"] == "good_ngsolve_esdirk4_graded"
    assert found["best_at_1e-3"] == "potential_order_3_graded"
    assert found["ratio_at_1e-3_is"] == "rival at most, ours measured"
    only = ratio(1e-3, at, ["dolfinx_euler_uniform"], "pressure_")
    assert only["pressure_ratio_to_best_rival_at_1e-3"] == 0.25


def test_reference_is_cubic_between_kinks():
    # Cubics are met exactly; the polynomial must not reach over a kink at 7080 s.
    def history(time):
        return 1 + 1e-9 * (time - 7080) ** 3 + np.maximum(time - 7080, 0) * 1e-2

    own = np.concatenate([np.linspace(7000, 7080, 9), np.linspace(7080, 7220, 11)[1:]])
    wanted = np.array([7003.0, 7079.0, 7080.0, 7081.0, 7219.0])
    reference = Reference(Course(own, history(own), None))
    assert reference.area(wanted) == pytest.approx(history(wanted), rel=1e-12)
    across = Reference(Course(own, history(own), None), kinks=(7000.0, 7220.0))
    assert np.abs(across.area(wanted) - history(wanted)).max() > 1e-3


def test_speed_error(tmp_path, monkeypatch):
    monkeypatch.setattr(speed_error, "SCRIPT", tmp_path / "plain_ngsolve.py")  # absent: said, and the ratios left out
    numbers, rows = quick("speed_error", tmp_path / "out")
    assert "absent" in numbers["plain"]
    assert not [key for key in numbers if key.startswith("ratio_to_plain")]
    assert "absent" in numbers["dolfinx"]
    for wanted in ("1e-2", "1e-3", "1e-4"):
        assert numbers[f"ratio_to_best_rival_at_{wanted}"] > 0
        assert numbers[f"best_rival_at_{wanted}"].startswith("good_ngsolve")
        assert numbers[f"pressure_ratio_to_best_rival_at_{wanted}"] > 0
    assert numbers["reference_area_error"] < 1e-5  # what the issue of a reference is: errors of 1e-4 are measured with it
    assert numbers["reference_pressure_error"] < 1e-4
    assert numbers["penalty_40_area_error"] < 1e-3
    errors = {(row[0], row[1]): float(row[8]) for row in rows[1:]}
    assert errors["potential_order_2_graded", "6 x 6"] < errors["potential_order_2_uniform", "6 x 6"]  # same cells and steps
    assert errors["paper", "4 x 4"] > 10 * numbers["reference_area_error"]


def test_a_plain_script_that_does_not_exist_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["speed_error", "--plain", str(tmp_path / "none.py")])
    assert "none.py" in capsys.readouterr().err


def test_iteration(tmp_path):
    numbers, _ = quick("iteration", tmp_path)
    for case in ("potential_44x40", "concentration_88x80"):
        # No times are compared: machines are shared. Old matrices serve several iterations whatever the machine does.
        assert numbers[f"{case}_iterations_per_matrix"] > 2
        assert all(numbers[f"{case}_{part}_ms"] > 0 for part in ("tangent", "residual", "factorise", "solve", "iteration"))
    assert numbers["loop_over_linear_algebra_potential_44_1_thread"] == numbers["potential_44x40_overhead"]
    assert numbers["quadrature_points"] == 16  # order 6 on quadrilaterals
    assert "absent" in numbers["dolfinx"]
    assert not [key for key in numbers if "rival" in key]


def test_an_iteration_over_the_rivals():
    ours = dict.fromkeys(PARTS, 6.0)
    run = SimpleNamespace(factorisations=10, solves=30, iterations=20)
    rival = {"tangent_ms": 2.0, "residual_ms": 3.0, "factorise_ms": 4.0, "solve_ms": 1.0, "points": 16}
    found = IterationCost("88x80", "concentration", ours, 1, run, 0.48, 16, rival).compared()
    assert found["tangent_over_rival_concentration_88"] == 3.0
    assert found["residual_over_rival_concentration_88"] == 2.0
    assert found["full_iteration_over_rival_concentration_88"] == 2.4
    assert found["rival_concentration_88x80_solve_ms"] == 1.0
    assert found["loop_over_linear_algebra_concentration_88_1_thread"] == pytest.approx(2.0)  # 480 ms over 40 times 6 ms
    assert not [key for key in IterationCost("44x40", "potential", ours, 1, run, 1.0, 16, None).compared() if "rival" in key]


def test_tolerance(tmp_path):
    numbers, _ = quick("tolerance", tmp_path)
    assert numbers["largest_ratio"] < 3
    # The bound holds for the stiffest scenes, with a factor of safety; smooth ones stay a tenth to a fiftieth below it.
    assert numbers["smallest_ratio_from_1e-3"] > 1 / 50
    for tolerance in ("1e-2", "1e-3", "1e-4", "1e-5"):
        assert (
            0 < numbers[f"median_error_over_tolerance_{tolerance}"] <= numbers[f"worst_error_over_tolerance_{tolerance}"] < 3
        )
    # Backward Euler controls its local error: what accumulates is an order larger, the control this study is about.
    assert (
        numbers["column_potential_euler_1e-2_displacement_error"] > 10 * numbers["column_potential_1e-2_displacement_error"]
    )


def test_without_its_safeguards_a_tolerance_is_missed(monkeypatch):
    # The controls: estimates ten times too low, which a disc's ramp notices, and sizes of at least a share of the natural
    # ones, as they were, which a small load notices.
    assert errors(random_run(17), (1e-4,))[1e-4] < 3
    assert errors(random_run(12), (1e-4,))[1e-4] < 3
    with monkeypatch.context() as without:
        without.setattr(sizes, "SAFETY", 0.1)
        without.setattr(sizes, "SAFETY_AFTER_KINK", 0.1)
        assert errors(random_run(17), (1e-4,))[1e-4] > 3
    found = Sizes._sizes
    monkeypatch.setattr(Sizes, "_sizes", lambda self, *more: np.maximum(found(self, *more), self._natural()))
    assert errors(random_run(12), (1e-4,))[1e-4] > 3
