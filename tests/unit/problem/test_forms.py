"""Terms joined and differentiated as one expression, against NGSolve's own differentiation of each term."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import BilinearForm, Id, InnerProduct, Variation, atan2, dx

from ngswell import (
    FibreReinforced,
    Fibres,
    HolmesMow,
    HolmesMowSolid,
    LogNeoHookean,
    MooneyRivlin,
    NeoHookean,
    Potential,
    TransverselyIsotropic,
)
from ngswell.models.term import Kind
from tests.scenes import deformed
from tests.unit.problem.test_discrete_system import DISCRETISATIONS, MOTIONS, body

ROUND_OFF = 1e-12
"""Of the largest value: sums over some hundred terms."""


def by_terms(problem):
    """Residual and its derivative over the body, every term an integral that NGSolve differentiates by evaluation."""
    form = BilinearForm(problem.space)
    rate = 1 / problem.dt
    for term in problem.terms:
        if term.boundary is None:
            factor = rate if term.kind is Kind.RATE else 1.0
            integral = factor * problem.kinematics.weight * term.integrand * dx(intrules=problem.rules)
            form += Variation(integral) if term.kind is Kind.ENERGY else integral
    vector = problem.fields.vec.CreateVector()
    form.Apply(problem.fields.vec, vector)
    form.AssembleLinearization(problem.fields.vec)
    return vector, form.mat


def check(problem):
    deformed(problem)
    problem.dt.Set(0.7)
    form = problem.form([term for term in problem.terms if term.boundary is None], 1 / problem.dt)
    found, moved, expected_moved = (problem.fields.vec.CreateVector() for _ in range(3))
    form.apply(found)
    matrix = form.linearise()
    expected, expected_matrix = by_terms(problem)
    assert close(found, expected)
    direction = problem.fields.vec.CreateVector()
    for seed in range(3):
        direction.FV().NumPy()[:] = np.random.default_rng(seed).standard_normal(direction.size) * problem.sizes
        moved.data, expected_moved.data = matrix * direction, expected_matrix * direction
        assert close(moved, expected_moved)
    return found, matrix


def close(found, expected):
    found, expected = found.FV().NumPy(), expected.FV().NumPy()
    return np.abs(found - expected).max() <= ROUND_OFF * np.abs(expected).max()


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", ["Concentration, Multiplier", "Potential, Penalty", "Potential, order 3"])
def test_models(name, motion):
    check(body(motion, *DISCRETISATIONS[name]).problem)


SOLIDS = [NeoHookean(), LogNeoHookean(), MooneyRivlin(0.3), HolmesMowSolid(0.5)]


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("solid", SOLIDS, ids=lambda solid: type(solid).__name__)
def test_solids(solid, motion):
    scene = body(motion, Potential(), *DISCRETISATIONS["Potential, Penalty"][1:])
    check(replace(scene, material=replace(scene.material, solid=solid)).problem)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize(
    "permeability", [HolmesMow(2.0, 1.0), TransverselyIsotropic((1, 0, 0), 3.0)], ids=lambda law: type(law).__name__
)
def test_permeabilities(permeability, motion):
    scene = body(motion, Potential(), *DISCRETISATIONS["Potential, Penalty"][1:])
    check(replace(scene, material=replace(scene.material, permeability=permeability)).problem)


class Squared:
    """A product of one tensor with itself has no symbolic derivative in NGSolve."""

    def energy(self, deformation, material):
        E = deformation.F.trans * deformation.F - Id(3)
        return LogNeoHookean().energy(deformation, material) + 0.1 * material.mu * InnerProduct(E, E)


class Turned:
    """Functions of two arguments have one, but not by a GridFunction."""

    def energy(self, deformation, material):
        angle = atan2(deformation.F[0, 1] ** 2, deformation.F[0, 0])
        return LogNeoHookean().energy(deformation, material) + 0.1 * material.mu * angle**2


def apart(problem):
    """Names of the terms that are not joined."""
    form = problem.form([term for term in problem.terms if term.boundary is None])
    return [str(term) for term in form._bodies[1]]


@pytest.mark.parametrize(
    "solid",
    [Squared(), Turned(), FibreReinforced(NeoHookean(), [Fibres((0, 0, 1), 1.5)])],
    ids=lambda law: type(law).__name__,
)
def test_what_cannot_be_joined_stays_apart(solid):
    scene = body("plane strain", Potential(), *DISCRETISATIONS["Potential, Penalty"][1:])
    problem = replace(scene, material=replace(scene.material, solid=solid)).problem
    check(problem)
    assert apart(problem) == ([] if isinstance(solid, Turned) else ["momentum: solid"])


def test_a_wrong_derivative_would_show():
    problem = body("axisymmetric", Potential(), *DISCRETISATIONS["Potential, Penalty"][1:]).problem
    found, _ = check(problem)
    expected, _ = by_terms(problem)
    found.FV().NumPy()[7] += 1e-9 * np.abs(expected.FV().NumPy()).max()
    assert not close(found, expected)


def test_joined_terms_are_right_where_contents_are_lumped():
    """Contents at corners, all else over the same cells: both sums are the same."""
    problem = body("plane strain", Potential(), *DISCRETISATIONS["Potential, Penalty"][1:]).problem
    deformed(problem)
    steady = [term for term in problem.terms if not term.lumps and term.boundary is None]
    lumps = [term for term in problem.terms if term.lumps]
    vectors = [problem.fields.vec.CreateVector() for _ in range(3)]
    problem.storage.lump(True)
    for terms, vector in zip((steady + lumps, steady, lumps), vectors, strict=True):
        problem.form(terms).apply(vector)
    whole, rest, contents = (vector.FV().NumPy() for vector in vectors)
    assert np.abs(contents).max() > 0
    assert whole == pytest.approx(rest + contents, abs=ROUND_OFF * np.abs(whole).max())
