"""The discrete system: linearisation, named terms, boundary measure, solvers, Newton's tests."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import L2, IfPos, LinearForm, ds, x, y

from ngswell import (
    TABLE_1,
    TABLE_2,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    Essential,
    Fixed,
    Frozen,
    Lagged,
    MackieMeares,
    Material,
    Multiplier,
    Newton,
    Nitsche,
    Penalty,
    PlaneStrain,
    Potential,
    PowerLaw,
    Ramp,
    Roller,
    Scene,
    Solid,
    StepError,
    Symmetry,
    Traction,
    Weight,
    box,
    column,
    rectangle,
)
from ngswell.baths.weak import normal_size
from ngswell.solve.direct import CondensedSolver, LinearSolver, best_solver, solver_of
from tests.scenes import confined_column, strip


def block(**changes) -> Scene:
    """A small block with everything a scene can have, out of equilibrium."""
    layered = Material(
        mu=0.12 + 0.05 * y, lam=0.02, nS0=IfPos(x - 0.5, 0.25, 0.2), cfc0=0.4 + 0.3 * x, D_plus=5e-4, D_minus=8e-4, K=1.07e-3
    )
    return Scene(
        **{
            "mesh": rectangle(1.0, 1.0, 2, 2),
            "kinematics": PlaneStrain(),
            "material": layered,
            "model": Concentration(),
            "supports": [Roller("bottom", "y"), Roller("left", "x")],
            "baths": [Bath("top", c=0.5, P=0.01, treatment=Penalty(3.0)), Bath("right", c=0.5, P=0.01)],
            "loads": [Traction("top", (0.01, -0.02)), Weight((0.0, -1e-2), (0.0, -2e-2))],
            **changes,
        }
    )


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
            box(1.0, 1.0, 1.0, 1, 1, 2), Solid(), [Roller("bottom", "xyz")], ("top", "right"),
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
SIZES = {
    "u": 0.02,
    "p": 0.05,
    "c": 0.1,
    "cfc": 0.05,
    "P": 0.05,
    "salt": 0.1,
    "efflux of fluid": 0.05,
    "efflux of cations": 0.05,
}


def deformed(problem, seed=1):
    """A state near the initial one in which every term acts."""
    problem.initialise()
    rng = np.random.default_rng(seed)
    for name, part in problem.ranges.items():
        problem.vector[part] += SIZES[name] * rng.standard_normal(part.stop - part.start)
    held = slice(0, problem.ranges["u"].stop)
    problem.vector[held] *= np.array(problem.free)[held]  # a cylinder's axis stays one: u_r/r would be infinite


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
        problem.form(term).Apply(problem.fields.vec, part)
        assert np.abs(part.FV().NumPy()).max() > 0, f"{term} does nothing"
        summed += part.FV().NumPy() / (0.7 if term.kind == "rate" else 1.0)
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


def test_descriptions_name_the_model_and_the_treatment():
    text = strip(Nitsche()).describe()
    assert "fluid: storage, seepage, efflux on top, adjoint on top" in text
    assert "bath on top: Nitsche, symmetric adjoint, γ = 20" in text
    assert "adjoint on" not in strip(Nitsche(adjoint="none")).describe()
    text = strip(Multiplier()).describe()
    assert "efflux of fluid 2, efflux of cations 2" in text  # linear traces on the one edge of the strip
    assert "equilibrium with the bath: fluid on top, cations on top" in text
    assert "bath on top: Lagrange multipliers" in text
    text = strip(None, model=Potential()).describe()
    assert text.startswith("Potential, PlaneStrain, order 2")
    assert "charge" not in text  # no field of its own
    assert "efflux" not in text
    assert "bath on top: prescribed" in text


def test_efflux_is_per_current_area():
    # Stretch the strip sideways by 20 %, lift p and c on top: the efflux is ε (p − p_D) times the deformed width.
    problem = strip(supports=[Roller("bottom", "y"), Roller("left", "x")]).problem
    problem.initialise()
    problem.fields.components[0].Set((0.2 * x, 0 * x))
    problem.vector[problem.ranges["p"]] += 0.01
    efflux = next(t for t in problem.terms if (t.balance, t.name) == ("fluid", "efflux"))
    vector = problem.fields.vec.CreateVector()
    problem.form(efflux).Apply(problem.fields.vec, vector)
    total = vector.FV().NumPy()[problem.ranges["p"]].sum()
    assert total == pytest.approx(0.01 * 0.02 * 1.2, rel=1e-12)


@pytest.mark.parametrize(("treatment", "h"), [(Penalty(relative=1e3), 0.5 / 30)])
def test_relative_penalty_is_a_multiple_of_K_over_h(treatment, h):
    raw = Penalty(1e3 * 1.07e-3 / h)
    results = []
    for each in (treatment, raw):
        problem = confined_column(each).problem
        problem.initialise()
        problem.vector[problem.ranges["p"]] += 0.01
        efflux = next(t for t in problem.terms if (t.balance, t.name) == ("fluid", "efflux"))
        vector = problem.fields.vec.CreateVector()
        problem.form(efflux).Apply(problem.fields.vec, vector)
        results.append(vector.FV().NumPy().sum())
    assert results[0] == pytest.approx(results[1], rel=1e-12)


@pytest.mark.parametrize(
    ("mesh", "motion", "size"),
    [
        (column(1.0, 4), Confined(), 1 / 4),
        (rectangle(1.0, 1.0, 4, 5), PlaneStrain(), 1 / 5),
        (rectangle(1.0, 1.0, 4, 5, triangles=True), PlaneStrain(), 1 / 5),
        (box(1.0, 1.0, 1.0, 2, 2, 3), Solid(), 1 / 3),
        (box(1.0, 1.0, 1.0, 2, 2, 3, cells="prisms"), Solid(), 1 / 3),
        (box(1.0, 1.0, 1.0, 2, 2, 3, cells="tetrahedra"), Solid(), 1 / 3),
    ],
    ids=["column", "quadrilaterals", "triangles", "hexahedra", "prisms", "tetrahedra"],
)
def test_normal_size_of_boundary_cells(mesh, motion, size):
    space = L2(mesh, order=0)
    form = LinearForm(space)
    form += normal_size(motion) * space.TestFunction() * ds(definedon=mesh.Boundaries("top"), skeleton=True)
    assert sum(form.Assemble().vec) == pytest.approx(size, rel=1e-12)  # on an area of 1 mm²


@pytest.mark.parametrize("name", sorted({"umfpack", best_solver()}))
def test_refactorisation_follows_the_matrix(name):
    problem = block().problem
    deformed(problem)
    solver = LinearSolver(problem.free, name)
    right, solution = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    free = np.array(list(problem.free))
    right.FV().NumPy()[:] = np.random.default_rng(3).standard_normal(right.size) * free
    for dt in (1.0, 100.0):
        problem.dt.Set(dt)
        matrix = problem.linearise()
        assert solver.factorise(matrix)
        assert solver.solve(right, solution)
        back = (matrix * solution).Evaluate().FV().NumPy()
        assert back[free] == pytest.approx(right.FV().NumPy()[free], abs=1e-8)
    assert solver.factorisations == 2


@pytest.mark.parametrize(
    ("mesh", "motion", "model", "treatment"),
    [
        (rectangle(1.0, 1.0, 3, 3), PlaneStrain(), Potential(), Essential()),
        (rectangle(1.0, 1.0, 3, 3), PlaneStrain(), Potential(4), Essential()),
        (rectangle(1.0, 1.0, 3, 3), PlaneStrain(), Concentration(3), Penalty(relative=1e3)),
        (rectangle(1.0, 1.0, 3, 3, triangles=True), PlaneStrain(), Concentration(4), Frozen()),
        (box(1.0, 1.0, 1.0, 2, 2, 2), Solid(), Potential(3), Essential()),
    ],
    ids=lambda value: str(value) if isinstance(value, (Concentration, Potential)) else None,
)
def test_condensed_corrections_are_those_of_the_whole_system(mesh, motion, model, treatment):
    sides = [name for name in dict.fromkeys(mesh.GetBoundaries()) if name != "top"]
    supports = [Symmetry(side) for side in sides if side in ("left", "front", "bottom")]
    bath = Bath("top", c=Ramp((0, 0.2), (1, 0.1)), treatment=treatment)
    scene = Scene(mesh=mesh, kinematics=motion, material=TABLE_2, model=model, supports=supports, baths=[bath])
    problem = scene.problem
    deformed(problem)
    problem.begin_step(1.0, 0.5)
    solvers = LinearSolver(problem.free), solver_of(problem)
    assert isinstance(solvers[1], CondensedSolver)
    right, gap, whole, condensed = (problem.fields.vec.CreateVector() for _ in range(4))
    problem.residual(right)
    gap.FV().NumPy()[:] = problem.gap()
    for solver, solution in zip(solvers, (whole, condensed), strict=True):
        assert solver.renew(problem)
        assert solver.solve(right, solution, gap if isinstance(treatment, (Essential, Frozen)) else None)
    free = np.array(list(problem.free))
    size = np.abs(whole.FV().NumPy()[free]).max()
    # Round-off times the condition of systems of up to some 400 unknowns in mixed units.
    assert condensed.FV().NumPy() == pytest.approx(whole.FV().NumPy(), abs=1e-9 * size)
    assert size > 1e-6


def test_side_integrals_with_normal_derivatives_are_not_condensed():
    # They reach the unknowns inside the cells, from outside the cell-wise elimination.
    scene = confined_column(Nitsche(), cells=3)
    assert type(solver_of(scene.problem)) is LinearSolver


def test_nan_in_the_matrix_is_noticed():
    problem = block().problem
    problem.initialise()
    matrix = problem.linearise()
    matrix.AsVector().FV().NumPy()[7] = np.nan
    assert not LinearSolver(problem.free).factorise(matrix)


def test_newton_does_not_depend_on_units():
    """The same scene with a stress and a length scaled: the same iterations, scaled results."""
    counts, ends = [], []
    for stress in (1.0, 1e-3):
        material = Material(
            mu=0.12 * stress, lam=0.02 * stress, nS0=0.25, cfc0=0.8, D_plus=5e-4, D_minus=8e-4, K=1.07e-3 / stress,
            theta=298.0,
        )  # fmt: skip
        scene = Scene(
            mesh=rectangle(1.0, 1.0, 3, 3),
            kinematics=PlaneStrain(),
            material=material,
            supports=[Roller("bottom", "y"), Roller("left", "x")],
            baths=[Bath("top", c=4.0, P=0.0, treatment=Penalty(relative=1e3))],
            initial=(4.0, 0.0),
            loads=[Traction("top", (0.0, -0.05 * stress))],
            charge=Ramp((0, 1e-9)),
        )
        result = scene.run(10.0, Fixed(5.0))
        counts.append([step.iterations for step in result.steps])
        ends.append(scene.problem.vector[scene.problem.ranges["u"]].copy())
    assert counts[0] == counts[1]
    assert ends[0] == pytest.approx(ends[1], rel=1e-6, abs=1e-9)


def test_a_step_that_cannot_succeed_restores_the_last_state():
    # A load that squeezes out more fluid than there is: the compression point is never passed.
    scene = strip(loads=[Traction("top", (0.0, -900.0))], c=0.15)
    with pytest.raises(StepError) as caught:
        scene.run(1e4, Fixed(100.0), newton=Newton(most_iterations=4))
    error = caught.value
    problem = scene.problem
    assert error.time < 1e4
    assert error.reason
    assert f"t = {error.time:.10g} s" in str(error)
    assert problem.inadmissible() is None
    assert np.isfinite(problem.vector).all()
    if error.time == 0.0:
        assert problem.vector == pytest.approx(problem.initial, abs=0)


def test_table_2_is_admissible_and_a_passed_pole_is_not():
    problem = strip(material=TABLE_2, loads=[]).problem
    problem.initialise()
    assert problem.inadmissible() is None
    problem.fields.components[0].Set((0 * x, -0.8 * y))
    name, where = problem.inadmissible()
    assert "J − nS0" in name
    assert len(where) == 2
    problem.initialise()
    problem.vector[problem.ranges["c"]] = np.nan
    assert problem.inadmissible() is not None
