"""The discrete system: linearisation, named terms, admissible states."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import x, y

from ngswell import (
    TABLE_1,
    TABLE_2,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    Lagged,
    MackieMeares,
    Material,
    Multiplier,
    Nitsche,
    Penalty,
    PlaneStrain,
    Potential,
    PowerLaw,
    Roller,
    Scene,
    Spatial,
    Traction,
    Weight,
    box,
    column,
    rectangle,
)
from ngswell.models.term import Kind
from tests.scenes import block, deformed, strip


def shapes(motion):
    """Mesh, kinematics, supports, two boundaries for baths that share a corner, and a vector along the last axis."""
    return {
        "confined": (column(1.0, 3), Confined(), [Roller("bottom", "x")], ("top",), lambda size: (size,)),
        "plane strain": (
            rectangle(1.0, 1.0, 2, 2), PlaneStrain(), [Roller("bottom", "y"), Roller("left", "x")], ("top", "right"),
            lambda size: (0.1 * size, size),
        ),
        "axisymmetric": (
            rectangle(1.0, 1.0, 2, 2, triangles=True), Axisymmetric(), [Roller("bottom", "z"), Roller("left", "r")],
            ("top", "right"), lambda size: (0.0, size),
        ),
        "3-d": (
            box(1.0, 1.0, 1.0, 1, 1, 2), Spatial(), [Roller("bottom", "xyz")], ("top", "right"),
            lambda size: (0.2 * size, 0.0, size),
        ),
    }[motion]  # fmt: skip


MOTIONS = ["confined", "plane strain", "axisymmetric", "3-d"]


def body(motion, model, *treatments):
    """A layered body with real solutions, weight and a load, and one bath a treatment, out of equilibrium."""
    mesh, kinematics, supports, boundaries, along = shapes(motion)
    material = Material(
        mu=0.12 + 0.05 * x, lam=0.02, nS0=0.25 - 0.05 * x, cfc0=0.4 + 0.3 * x, D_plus=5e-4, D_minus=8e-4, K=1.07e-3,
        permeability=PowerLaw(2.0), diffusivity=MackieMeares(), phi=0.9, phi_bath=0.95, Gamma=1.1,
    )  # fmt: skip
    baths = [Bath(name, c=0.5, P=0.01, treatment=each) for name, each in zip(boundaries, treatments, strict=False)]
    loads = [Traction("top", along(-0.02)), Weight(along(-1e-2), along(-2e-2))]
    return Scene(
        mesh=mesh, kinematics=kinematics, material=material, model=model, supports=supports, baths=baths, loads=loads
    )


NITSCHE = [Nitsche(adjoint=adjoint) for adjoint in ("symmetric", "skew", "none")]


DISCRETISATIONS = {
    "Concentration, Nitsche symmetric": (Concentration(), NITSCHE[0], Penalty(3.0)),
    "Concentration, Nitsche skew": (Concentration(), NITSCHE[1], Nitsche(0.0, "skew")),
    "Concentration, Nitsche none": (Concentration(3), NITSCHE[2], NITSCHE[0]),
    "Concentration, Multiplier": (Concentration(), Multiplier(), Multiplier()),
    "Concentration, Multiplier beside Penalty": (Concentration(3), Multiplier(), Penalty(3.0)),
    "Concentration, Multiplier beside Nitsche": (Concentration(), Multiplier(), NITSCHE[0]),
    "Potential, Penalty": (Potential(), Penalty(3.0), Penalty(relative=10.0)),
    "Potential, order 3": (Potential(3), Penalty(3.0), Penalty(relative=10.0)),
}


def central_difference_errors(problem, steps):
    """Largest deviation of the linearisation from central differences of the residual, relative, for each of `steps`."""
    deformed(problem)
    problem.begin_step(1.0, 0.7)
    state = problem.vector.copy()
    direction = np.random.default_rng(2).standard_normal(state.size) * 0.01 * np.array(problem.free)
    vector, plus, minus = (problem.fields.vec.CreateVector() for _ in range(3))
    vector.FV().NumPy()[:] = direction
    exact = (problem.linearise() * vector).Evaluate().FV().NumPy().copy()
    errors = []
    for h in steps:
        problem.vector[:] = state + h * direction
        problem.residual(plus)
        problem.vector[:] = state - h * direction
        problem.residual(minus)
        difference = (plus.FV().NumPy() - minus.FV().NumPy()) / (2 * h)
        errors.append(
            [np.abs((difference - exact)[part]).max() / np.abs(exact[part]).max() for part in problem.ranges.values()]
        )
    return np.array(errors)


@pytest.mark.parametrize("order", [2, 3])
def test_linearisation_is_the_derivative_of_the_residual(order):
    coarse, fine = central_difference_errors(block(model=Concentration(order=order)).problem, (1e-2, 5e-3)).max(axis=1)
    assert fine < 1e-4
    assert coarse / fine == pytest.approx(4, rel=0.1)  # central differences are of second order


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", DISCRETISATIONS)
def test_linearisation_of_models_and_treatments(name, motion):
    coarse, fine = central_difference_errors(body(motion, *DISCRETISATIONS[name]).problem, (0.2, 0.1))
    assert fine.max() < 3e-4  # measured at most 1e-4
    # Central differences are of second order, balance by balance; where the residual is nearly linear, round-off of 1e-11.
    assert (fine < np.maximum(coarse / 3.6, 1e-10)).all()


def check_terms(problem):
    """They add up to the residual, and none is idle."""
    deformed(problem)
    problem.dt.Set(0.7)
    total, part = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    problem._old_contents[:] = 0.0
    problem.residual(total)
    summed = np.zeros(total.size)
    for term in problem.terms:
        problem.form([term]).apply(part)
        assert np.abs(part.FV().NumPy()).max() > 0, f"{term} does nothing"
        summed += part.FV().NumPy() / (0.7 if term.kind is Kind.RATE else 1.0)
    assert summed == pytest.approx(total.FV().NumPy(), abs=1e-13)


def test_terms_add_up_to_the_residual():
    check_terms(block().problem)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", DISCRETISATIONS)
def test_terms_of_models_and_treatments_add_up(name, motion):
    check_terms(body(motion, *DISCRETISATIONS[name]).problem)


def test_a_scene_has_only_the_terms_it_needs():
    bare = strip().describe()
    assert "weight" not in bare
    assert "traction on top" in bare
    assert "efflux on top" in bare
    assert "efflux" not in strip(Lagged()).describe()
    assert "traction" not in strip(loads=[]).describe()
    assert "weight" in block().describe()
    assert "permeability" not in bare
    assert "permeability: PowerLaw(m=2.0)" in strip(material=replace(TABLE_1, permeability=PowerLaw(2.0))).describe()


def test_table_2_is_admissible_and_a_passed_pole_is_not():
    problem = strip(material=TABLE_2, loads=[]).problem
    problem.initialise()
    assert problem.admissible.violation() is None
    problem.fields.components[0].Set((0 * x, -0.8 * y))
    name, where, _ = problem.admissible.violation()
    assert "J − nS0" in name
    assert len(where) == 2
    problem.initialise()
    problem.vector[problem.ranges["c"]] = np.nan
    assert problem.admissible.violation() is not None
