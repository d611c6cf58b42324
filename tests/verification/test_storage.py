"""Salt that is stored at the vertices where the integrals of what cells hold fail: positivity, conservation, orders."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from ngsolve import CF, H1, BilinearForm, Integrate, dx, x

from ngswell import TABLE_1, Adaptive, Fixed, Ramp, column, rectangle
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.mesh.points import vertices
from ngswell.problem.lumping import VERTEX_RULES, vertex_weights
from ngswell.problem.problem import Problem
from studies.hard_cases.attempt import CHOICES, attempt
from studies.hard_cases.bodies import ACCURATE, CELLS, at_rest, column_scene, distance
from studies.hard_cases.charge import UNCHARGED
from studies.limits.manufactured import SLOW, ManufacturedPotential, errors, orders
from studies.scenes import BATH, P0

RISING = ((1e-9, 5.0, 0.0), (1e-9, 5.0, 100.0), (1e-4, 5.0, 100.0), (BATH, 5.0, 1.0))
"""Baths that rise: before and after [mol/l], within [s]."""


@pytest.fixture
def always(monkeypatch):
    """Salt is lumped in every step."""
    carried = Problem.carried
    monkeypatch.setattr(Problem, "carried", lambda self, lumped: carried(self, True))


@pytest.fixture
def never(monkeypatch):
    """Salt is never lumped."""
    carried = Problem.carried
    monkeypatch.setattr(Problem, "carried", lambda self, lumped: carried(self, False))


def rising(name, before, after, within, order=2):
    """An attempt at a bath that rises, on the column of ten cells: J at the end against its closed form, as `bath_range`."""
    model, treatment = CHOICES[name]
    bath = Ramp((0.0, before), (within, after)) if within else after
    J = homogeneous_equilibrium(TABLE_1, after, "confined", load=P0).J
    make = partial(column_scene, replace(model, order=order), treatment, bath, cells=10)
    error = partial(distance, {"J": lambda *at: J}, 4)
    start = partial(at_rest, before, "confined", P0)
    return attempt("", name, make, 3e6, "J", error, 1e-8, Adaptive(1e-2), start=start, newton=ACCURATE)


@pytest.mark.parametrize("change", RISING, ids=str)
@pytest.mark.parametrize("name", ["Potential", "Concentration", "Concentration, Multiplier"])
def test_baths_rise_from_next_to_nothing(name, change):
    found = rising(name, *change)
    # Error and ledger within the bounds of `bath_range`, 1e-8 and 1e-7: contents are carried over when they are lumped.
    assert found.outcome == "passes", found.message


def test_so_they_do_with_unknowns_inside_cells():
    assert rising("Potential", 1e-4, 5.0, 100.0, order=3).outcome == "passes"


@pytest.mark.parametrize("change", RISING[1:], ids=str)
def test_integrals_alone_stop(never, change):
    """Negative control."""
    assert rising("Potential", *change).outcome == "stops"


# -- what is lumped ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mesh", "weight"),
    [(column(1.0, 5, grade={"top": 10}), CF(1.0)), (rectangle(1.0, 2.0, 3, 2), x)],
    ids=["graded", "with an axis"],
)
def test_vertex_weights_are_the_sums_of_rows(mesh, weight):
    space = H1(mesh, order=1)
    u, v = space.TnT()
    lumped, whole = (BilinearForm(space) for _ in range(2))
    lumped += vertex_weights(mesh, weight) * u * v * dx(intrules=VERTEX_RULES)
    whole += weight * u * v * dx(bonus_intorder=1)
    rows, columns, values = map(np.asarray, lumped.Assemble().mat.COO())
    assert np.abs(values[rows != columns]).max() == 0.0
    diagonal = np.bincount(rows, values)
    of, _, consistent = map(np.asarray, whole.Assemble().mat.COO())
    np.testing.assert_allclose(diagonal, np.bincount(of, consistent), rtol=1e-12)  # round-off
    assert diagonal.min() > 0
    assert diagonal.sum() == pytest.approx(Integrate(weight, mesh), rel=1e-12)


def lowest_share(name, step):
    """The least that one step gives a node of the bath's jump, in a column without charge, where salt only diffuses."""
    after = 2 * BATH
    scene = column_scene(*CHOICES[name], after, CELLS, UNCHARGED, loads=())
    state = scene.run(step, Fixed(step), newton=ACCURATE).state
    values = np.array([state.output("c_plus")(scene.mesh(*place)) for place in vertices(scene.mesh)])
    return float((values - BATH).min() / (after - BATH))


@pytest.mark.parametrize("name", ["Potential", "Concentration"])
@pytest.mark.parametrize("step", [1e-6, 1e-3, 0.1, 10.0])
def test_lumped_salt_stays_between_what_was_and_what_is_prescribed(always, name, step):
    assert lowest_share(name, step) > -1e-9  # Newton's tolerance, 1e-8, squared but for penalties


def test_integrated_salt_alternates_below_the_limit(never):
    """Negative control: √3 − 2 for vanishing steps, nothing in steps beyond h²/(6 κ), 0.2 s."""
    assert lowest_share("Potential", 1e-6) == pytest.approx(np.sqrt(3) - 2, rel=1e-3)
    assert lowest_share("Potential", 10.0) > -1e-9


@pytest.mark.parametrize(("order", "cells"), [(2, (6, 12)), (3, (4, 8))])
@pytest.mark.parametrize("model", [{}, {"model": ManufacturedPotential}], ids=["Concentration", "Potential"])
def test_lumped_salt_is_of_order_two(always, model, order, cells):
    """Whatever the order of u: ions inside cells are then those of the vertices. Measured: 1.98 to 2.05."""
    coarse, fine = (errors("plane strain", order, n, SLOW, **model) for n in cells)
    observed = orders(coarse, fine, 2)
    for name in {"u", "p", "c", "cfc", "P", "salt"} & set(observed):
        assert observed[name] > 1.9, observed


@pytest.mark.parametrize("order", [2, 3])
def test_a_change_of_storage_neither_adds_nor_takes_salt(order):
    """What the vertices hold is carried over; what other functions hold is in no sum."""
    model, treatment = CHOICES["Potential"]
    problem = column_scene(replace(model, order=order), treatment, BATH, 10).problem
    problem.initialise()
    problem.fields.components[2].Set(0.1 + 0.2 * x * x)
    salt = problem.ranges["salt"]
    at_vertices = slice(salt.start, salt.start + problem.mesh.nv)
    integrals, carried, lumped = (problem.carried(now).copy() for now in (False, True, True))
    np.testing.assert_array_equal(carried[at_vertices], integrals[at_vertices])
    assert not carried[at_vertices.stop : salt.stop].any()  # holds nothing while lumped
    assert np.abs(lumped[at_vertices] - integrals[at_vertices]).max() > 1e-3 * integrals[at_vertices].max()
    np.testing.assert_array_equal(problem.carried(False)[at_vertices], lumped[at_vertices])
