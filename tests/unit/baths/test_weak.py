"""Weak baths: efflux per current area, penalties and sizes of boundary cells."""

import pytest
from ngsolve import L2, LinearForm, ds, x

from ngswell import Confined, Penalty, PlaneStrain, Roller, Spatial, box, column, rectangle
from ngswell.baths.treatment import normal_size
from tests.scenes import confined_column, strip


def test_efflux_is_per_current_area():
    # Stretch the strip sideways by 20 %, lift p and c on top: the efflux is ε (p − p_D) times the deformed width.
    problem = strip(supports=[Roller("bottom", "y"), Roller("left", "x")]).problem
    problem.initialise()
    problem.fields.components[0].Set((0.2 * x, 0 * x))
    problem.vector[problem.ranges["p"]] += 0.01
    efflux = next(t for t in problem.terms if (t.balance, t.name) == ("fluid", "efflux"))
    vector = problem.fields.vec.CreateVector()
    problem.form([efflux]).apply(vector)
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
        problem.form([efflux]).apply(vector)
        results.append(vector.FV().NumPy().sum())
    assert results[0] == pytest.approx(results[1], rel=1e-12)


@pytest.mark.parametrize(
    ("mesh", "motion", "size"),
    [
        (column(1.0, 4), Confined(), 1 / 4),
        (rectangle(1.0, 1.0, 4, 5), PlaneStrain(), 1 / 5),
        (rectangle(1.0, 1.0, 4, 5, triangles=True), PlaneStrain(), 1 / 5),
        (box(1.0, 1.0, 1.0, 2, 2, 3), Spatial(), 1 / 3),
        (box(1.0, 1.0, 1.0, 2, 2, 3, cells="prisms"), Spatial(), 1 / 3),
        (box(1.0, 1.0, 1.0, 2, 2, 3, cells="tetrahedra"), Spatial(), 1 / 3),
    ],
    ids=["column", "quadrilaterals", "triangles", "hexahedra", "prisms", "tetrahedra"],
)
def test_normal_size_of_boundary_cells(mesh, motion, size):
    space = L2(mesh, order=0)
    form = LinearForm(space)
    form += normal_size(motion) * space.TestFunction() * ds(definedon=mesh.Boundaries("top"), skeleton=True)
    assert sum(form.Assemble().vec) == pytest.approx(size, rel=1e-12)  # on an area of 1 mm²
