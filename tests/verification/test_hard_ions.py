"""What the bounds of the hard cases of ions, time and contrasts rest on (`studies/hard_cases/`)."""

import numpy as np
import pytest

from ngswell import TABLE_1, Adaptive, DampedNewton, Fixed, Ledger, Penalty, Probe, Ramp, StepError, column
from ngswell.closed_forms.linear_column import LinearColumn, conductance
from ngswell.stepping.timetable import following
from studies.hard_cases.attempt import CHOICES
from studies.hard_cases.baths import penalised_efflux, relaxed
from studies.hard_cases.bodies import CELLS, column_scene
from studies.hard_cases.charge import CHARGED
from studies.hard_cases.contrasts import layered, skin
from studies.hard_cases.linear import COUNT, followed, linear_column
from studies.hard_cases.time import allowed, alternating, alternation
from studies.scenes import BATH
from studies.scenes import COLUMN_HEIGHT as HEIGHT


def test_the_last_correction_keeps_the_state_admissible():
    """Next to pure water c̃ is below Newton's tolerance: the correction applied last may take it below zero."""
    for name, (model, treatment) in CHOICES.items():
        scene = column_scene(model, treatment, Ramp((0.0, 1.0), (10.0, 1e-9)), 10, initial=(1.0, 0.0))
        scene.problem.restore(scene.run(1e5, newton=DampedNewton()).end)
        assert scene.problem.admissible.violation() is None, name


# -- sudden steps --------------------------------------------------------------------------------------------------------


def test_the_first_step_alternates_below_the_limit_only():
    found = alternation(quick=True)
    # The same closed form, by its lowest value; 1e-5 as in `sudden_steps`.
    np.testing.assert_allclose(found["found"], found["closed"], atol=1e-5)
    assert found["found"][found["r"] < 1e-3].max() == pytest.approx(np.sqrt(3) - 2, rel=0.05)
    assert found["found"][found["r"] > 1 / 6].min() > -1e-5


def test_shares_fall_by_the_projections_factor_from_node_to_node():
    shares = alternating(1e-9, "p")
    np.testing.assert_allclose(shares[1:6] / shares[:5], np.sqrt(3) - 2, rtol=1e-6)  # r → 0, h²/κ = 1 s
    assert allowed(1e-6) == pytest.approx(1.05 * (2 - np.sqrt(3)) + 1e-3, rel=1e-4)
    assert allowed(1.0) == 1e-3


# -- the linear column ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [1.0, 20.0, 1e3])
def test_the_spectral_column_is_the_series(step):
    series = LinearColumn(TABLE_1, BATH, HEIGHT).top_displacement(step * np.arange(1, COUNT + 1), salt=1.0, step=step)
    L = conductance(TABLE_1, BATH)
    # `TERMS` modes leave 2.5e-9 at 1 s; two layers of the same material are one.
    np.testing.assert_allclose(linear_column([(HEIGHT, L)], step, COUNT), series, rtol=1e-8)
    np.testing.assert_allclose(linear_column([(0.2, L), (0.3, L)], step, COUNT), series, rtol=1e-8)
    # G⁻¹ of 1e8 K/h adds 1e-8 of a cell's resistance.
    G = penalised_efflux(CHOICES["Concentration"][0], 1e8)
    np.testing.assert_allclose(linear_column([(HEIGHT, L)], step, COUNT, G), series, rtol=1e-7)


@pytest.mark.parametrize("name", ["Potential", "Concentration"])
def test_a_vanishing_penalty_leaves_a_uniform_column(name):
    model, _ = CHOICES[name]
    L = conductance(TABLE_1, BATH)
    # The column's own resistance is 20 cells' against 1/ε of one: differences of the order of 20 ε/3.
    for relative in (1e-4, 1e-2):
        step = 50.0 / relative
        spectral = linear_column([(HEIGHT, L)], step, COUNT, penalised_efflux(model, relative))
        assert np.abs(relaxed(model, relative, step) / spectral - 1).max() < 20 * relative


@pytest.mark.parametrize(("name", "exact"), [("Potential", "Potential"), ("Concentration", "Concentration, Multiplier")])
def test_large_penalties_approach_the_exact_treatment(name, exact):
    def displacement(name, treatment):
        top = Probe((HEIGHT,), "displacement")
        scene = column_scene(CHOICES[name][0], treatment, 0.1, CELLS)
        scene.run(200.0, Fixed(20.0), [top], newton=DampedNewton())
        return top.values["displacement"].ravel()[1:]

    limit = displacement(exact, CHOICES[exact][1])
    off = [np.abs(displacement(name, Penalty(relative=e)) / limit - 1).max() for e in (1e2, 1e3, 1e4)]
    assert off[0] < 1e-2
    np.testing.assert_allclose(np.array(off[1:]) * 10, off[:-1], rtol=0.05)  # flux/ε


# -- contrasts -----------------------------------------------------------------------------------------------------------


def test_layers_converge_with_the_square_of_the_cell():
    material, layers = layered("K and D", "bath")
    reference = linear_column(layers, 5e4, COUNT)
    errors = [followed("", "Potential", reference, 5e4, 1.0, column(HEIGHT, n), material).error for n in (10, 20, 40)]
    assert errors[-1] < 1e-3
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 4, rtol=0.05)


def test_a_skin_thinner_than_the_cells_needs_grading():
    """Negative control: on even cells the displacement is off by several times itself."""
    found = skin(quick=True)
    assert found["even"].min() > 1
    assert found["graded"][-1] < 5e-3
    # and exchanging the layers is not within the bounds either
    material, _ = layered("K and D", "bath")
    _, swapped = layered("K and D", "bottom")
    reference = linear_column(swapped, 5e4, COUNT)
    assert followed("", "Potential", reference, 5e4, 5e-3, column(HEIGHT, 20), material).outcome == "wrong"


# -- time ----------------------------------------------------------------------------------------------------------------


def test_kinks_are_found_by_bisection():
    times = [0.0, 1.0, 1.0 + 1e-13, 2.0]
    assert following(times, 0.5) == (False, 1.0)
    assert following(times, 1.0) == (True, 2.0) == following(times, 1.0 + 2e-13)
    assert following(times, 2.0) == (True, np.inf)
    assert following([], 1.0) == (False, np.inf)


def test_a_retried_step_counts_the_old_charge():
    """A charge that outruns the salt is retried without extrapolation; its ions must not come out of nothing."""
    ledger = Ledger()
    scene = column_scene(*CHOICES["Potential"], BATH, 10, CHARGED, loads=(), charge=Ramp((0.0, 0.0), (1e3, 1.0)))
    with pytest.raises(StepError):  # anions run out
        scene.run(1e3, Adaptive(1e-2), [ledger], newton=DampedNewton())
    # Round-off and Newton's remainder. It was open by 1e-3 and more when the new charge was taken for the old contents.
    assert max(ledger.imbalance().values()) < 1e-9
