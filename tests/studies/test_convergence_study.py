"""The study of convergence at its quick size: the cause, its controls, and the runs."""

import numpy as np
import pytest

from ngswell import TABLE_2
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from studies.limits.convergence.spectra import growth_rates, held_sideways, swell, undrained
from studies.limits.convergence.variants import VARIANTS, as_variant
from studies.scenes import free_swelling_block
from tests.studies.quick import quick


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return quick("convergence", tmp_path_factory.mktemp("convergence"))


def test_the_smooth_pressure_softens_the_surface(study):
    numbers, _ = study
    # Incompressible: Biot's cubic r³ + r² + 3 r − 1 = 0, r = 1/J; linear interpolation on a fine grid.
    r = 1 / numbers["biot_critical_J"]
    assert r**3 + r**2 + 3 * r == pytest.approx(1, abs=1e-5)
    for cells in (4, 8):
        # Between the surface with the solid's bulk stiffness alone and the incompressible one: what the discrete p resists.
        assert numbers["solid_critical_J"] < numbers[f"smooth_critical_J_{cells}"] < 2
        assert 2.5 < numbers[f"present_critical_J_{cells}"] < numbers["biot_critical_J"]
        assert numbers[f"smooth_negative_{cells}_J_2.75"] > 0 == numbers[f"present_negative_{cells}_J_2.75"]
    # A finer mesh has more cells at the surface to wrinkle.
    assert numbers["smooth_negative_8_J_2.75"] >= 2 * numbers["smooth_negative_4_J_2.75"]
    assert numbers["smooth_eigenvalue_8_J_2.75"] < numbers["smooth_eigenvalue_4_J_2.75"]


def test_the_surface_is_where_it_happens(study):
    # Control. With the surface held, p and the slope of the bulk energy work on a null Lagrangian: µ |Grad v|² is left,
    # whose share is 1, and what resists changes of volume, zero for fields without divergence. Round-off of a dense solver.
    numbers, _ = study
    for name in ("present", "smooth"):
        assert numbers[f"{name}_held_eigenvalue_8"] == pytest.approx(1, abs=1e-9)
    problem = held_sideways("smooth", 8, 0.3).problem
    swell(problem, 2.5, 0.3)
    problem.vector[problem.ranges["u"]] = undrained(problem).mode
    size = [np.abs(problem.state.u(problem.mesh(0.125, depth))).max() for depth in (0.375, 0.275, 0.175)]
    assert size[0] > 5 * size[1] > 5 * size[2]  # falls off within a cell or two


def test_small_steps_follow_the_growth_and_large_ones_hide_it(study):
    numbers, rows = study
    # What grows begins where the drained surface wrinkles in closed form, in every variant: between two of the baths.
    for row in (row for row in rows if row[0] == "growth" and row[2] == "8"):
        assert (float(row[4]) > 0) == (float(row[3]) > numbers["drained_critical_J"]), row
    assert numbers["smooth_growth_8_bath_0.1"] > 100 * numbers["present_growth_8_bath_0.1"] > 0
    # The measured rate is that of the mode that leads, up to the share of the next one (207 per second).
    assert numbers["smooth_measured_growth"] == pytest.approx(numbers["smooth_growth_4_bath_0.1"], rel=0.02)
    assert numbers["smooth_disturbance_ms"] > 1e-4  # from 1e-8, until the corner of a cell folds
    assert numbers["smooth_disturbance_s"] < 1e-10  # 1/(1 − s Δt) = −1/225
    assert numbers["present_disturbance_ms"] < 1e-7  # exp(0.56 · 0.06) = 1.03
    assert numbers["present_disturbance_s"] > 1e-2  # 1/(1 − 0.56) = 2.3 a step: the wrinkles of the model itself


def test_a_negative_eigenvalue_alone_does_not_grow():
    # At rest in 0.3 mol/l the smooth p has a saddle, but what moves no fluid follows the state at once: nothing grows.
    J = homogeneous_equilibrium(TABLE_2, 0.3, "confined").J
    problem = held_sideways("smooth", 4, 0.3).problem
    swell(problem, J, 0.3)
    assert undrained(problem).values[0] < 0
    assert growth_rates(problem)[0].real < 0


@pytest.mark.parametrize("time", [7000.0, 11000.0])
def test_a_freely_swollen_gel_has_no_such_modes(time):
    # Swollen alike in all directions (J = 1.41 and 3.05) nothing is compressed along the surface: J alone is not the cause.
    block = as_variant(free_swelling_block(8, 8), "smooth")
    block.equilibrate(time)
    assert undrained(block.problem).values[0] > 0


def test_every_variant_starts_from_the_same_rest():
    # At rest cfc is uniform and the variants differ by nothing: Newton's tolerance.
    states = [as_variant(free_swelling_block(4, 4), name).equilibrate(7000.0).values for name in VARIANTS]
    for other in states[1:]:
        assert other == pytest.approx(states[0], abs=1e-7)


def test_large_steps_pass(study):
    numbers, rows = study
    assert numbers["runs_passed"] == sum(row[0] == "run" for row in rows) == 4
    assert all(value == -1 for key, value in numbers.items() if key.endswith("first_rejection_s"))
