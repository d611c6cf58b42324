"""Where lagged baths take their charge from: known answers on polynomial charge fields."""

import numpy as np
import pytest
from ngsolve import CF

from ngswell import (
    TABLE_1,
    Averaged,
    Bath,
    Concentration,
    InnerLayer,
    InputError,
    Lagged,
    LeastSquares,
    box,
    column,
    rectangle,
)
from ngswell.baths.boundary import BathBoundary
from ngswell.baths.lagged import Slopes
from ngswell.mesh.points import vertices
from ngswell.physics import donnan
from tests.scenes import confined_column, quarter, strip

RULES = [InnerLayer(), Averaged(), LeastSquares()]


def sampled(rule, mesh, boundary, charge, baths=None, slopes=None):
    """The boundary's places and what the rule makes of the charge field `charge(*coordinates)`."""
    at = BathBoundary(mesh, boundary, baths or boundary)
    charges = charge(*vertices(mesh).T) + 0 * vertices(mesh)[:, 0]
    ones = np.ones(len(at.vertices))
    return at.places, rule.sample(charges, at, slopes or Slopes(ones, ones))


@pytest.mark.parametrize("rule", [*RULES, LeastSquares(2)])
@pytest.mark.parametrize(
    ("mesh", "boundary"),
    [
        (column(1.0, 4), "top"),
        (rectangle(1.0, 2.0, 3, 4), "top|left"),
        (rectangle(1.0, 2.0, 3, 4, triangles=True), "top|left|right|bottom"),
        (box(1.0, 1.0, 1.0, 2, 2, 2, cells="tetrahedra"), "top|left|front|back|right|bottom"),
    ],
)
def test_a_constant_charge_stays(rule, mesh, boundary):
    _, found = sampled(rule, mesh, boundary, lambda *x: 0.3)
    assert found == pytest.approx(0.3, rel=1e-14)  # round-off of a mean and of least squares


def test_averaged_keeps_a_linear_charge_inside_a_uniform_boundary():
    places, found = sampled(Averaged(), rectangle(1.0, 1.0, 4, 2), "top", lambda x, y: 0.1 + x)
    wanted = 0.1 + places[:, 0]
    inside = (places[:, 0] > 0) & (places[:, 0] < 1)
    assert inside.sum() == 3
    assert found[inside] == pytest.approx(wanted[inside], rel=1e-14)
    # At either end the mean of two vertices, half a cell off.
    assert np.sort(np.abs(found - wanted)[~inside]) == pytest.approx([0.125, 0.125], rel=1e-13)


def test_averaged_in_space_takes_the_vertices_across_edges():
    places, found = sampled(Averaged(), box(1.0, 1.0, 1.0, 4, 4, 2), "top", lambda x, y, z: 0.1 + x - 0.5 * y)
    inside = (np.abs(places[:, :2] - 0.5) < 0.4).all(axis=1)
    assert inside.sum() == 9
    assert found[inside] == pytest.approx((0.1 + places @ [1, -0.5, 0])[inside], rel=1e-13)


def test_averaged_leaves_a_third_of_a_saw_tooth():
    _, found = sampled(Averaged(), rectangle(1.0, 1.0, 8, 1), "top", lambda x, y: np.cos(8 * np.pi * x))
    assert np.abs(found[np.abs(found) > 1e-9]).min() == pytest.approx(1 / 3, rel=1e-12)


def test_inner_layer_is_one_cell_below():
    # Linear along the boundary: kept inside by symmetry. Linear in depth: the value a cell, 0.25 mm, below.
    places, found = sampled(InnerLayer(), rectangle(1.0, 1.0, 4, 4), "top", lambda x, y: 2 * x + y)
    inside = (places[:, 0] > 0) & (places[:, 0] < 1)
    assert found[inside] == pytest.approx(2 * places[inside, 0] + 0.75, rel=1e-14)
    assert found[~inside] != pytest.approx(2 * places[~inside, 0] + 0.75, rel=1e-2)


def test_inner_layer_in_corners():
    def at_corner(**mesh):
        places, found = sampled(
            InnerLayer(), rectangle(1.0, 1.0, 4, 4, **mesh), "top|right|left|bottom", lambda x, y: x + 10 * y
        )
        return {tuple(place): value for place, value in zip(places, found, strict=True)}

    # Of a corner cell one vertex is inner, a cell off on both sides.
    quads = at_corner()
    assert quads[0.0, 0.0] == pytest.approx(0.25 + 2.5, rel=1e-14)
    assert quads[1.0, 1.0] == pytest.approx(0.75 + 7.5, rel=1e-14)
    # Cut into triangles, two corners have cells without an inner vertex: the nearest ones stand in, here the same.
    triangles = at_corner(triangles=True)
    for corner in (0.0, 1.0):
        for other in (0.0, 1.0):
            wanted = (0.25 if corner == 0 else 0.75) + 10 * (0.25 if other == 0 else 0.75)
            assert triangles[corner, other] == pytest.approx(wanted, rel=1e-14)


def test_vertices_at_another_bath_are_not_inner():
    mesh = rectangle(1.0, 1.0, 4, 4)
    alone = sampled(InnerLayer(), mesh, "top", lambda x, y: x + 0 * y)[1]
    beside = sampled(InnerLayer(), mesh, "top", lambda x, y: x + 0 * y, baths="top|right")[1]
    assert np.count_nonzero(np.abs(alone - beside) > 1e-12) == 2  # the corner and the vertex beside it


def test_inner_layer_needs_inner_vertices():
    with pytest.raises(InputError, match=r"InnerLayer on 'top\|bottom'.*refine"):
        sampled(InnerLayer(), rectangle(1.0, 1.0, 3, 1), "top|bottom", lambda x, y: x)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_least_squares_reproduces_its_degree(degree):
    cases = (
        (rectangle(1.3, 1.0, 5, 4), "top"),
        (rectangle(1.3, 1.0, 5, 4), "top|right"),
        (rectangle(1.3, 1.0, 5, 4, triangles=True), "top|right|bottom"),
        (box(1.0, 1.0, 2.0, 4, 4, 4), "top|right"),
    )
    for mesh, boundary in cases:
        along = lambda x, y, *z: 0.5 + (x - 0.4 * y) ** degree  # noqa: E731
        beyond = lambda x, y, *z: 0.5 + (x - 0.4 * y) ** (degree + 1)  # noqa: E731
        places, found = sampled(LeastSquares(degree), mesh, boundary, along)
        assert found == pytest.approx(along(*places.T), abs=1e-12)  # conditioning of a few monomials on ±1
        places, found = sampled(LeastSquares(degree), mesh, boundary, beyond)
        assert np.abs(found - beyond(*places.T)).max() > 1e-3  # the next degree is beyond it


def test_least_squares_of_degree_0_is_the_weighted_mean():
    # Areas of hat functions on three cells: 1/6, 1/3, 1/3, 1/6; slopes weigh in with their squares.
    mesh = rectangle(1.0, 1.0, 3, 1)
    slopes = Slopes(np.array([1.0, 2.0, 0.5, 3.0]), np.array([0.3, 0.1, 0.7, 0.9]))
    places, found = sampled(LeastSquares(0, (2.0, 5.0)), mesh, "top", lambda x, y: 1 + x * x, slopes=slopes)
    weights = np.where((places[:, 0] > 0) & (places[:, 0] < 1), 1 / 3, 1 / 6) * (2 * slopes.p**2 + 5 * slopes.c**2)
    assert found == pytest.approx(np.average(1 + places[:, 0] ** 2, weights=weights), rel=1e-13)


@pytest.mark.parametrize("weights", [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
def test_linearised_weights_find_the_least_error_of_p_and_c(weights):
    """Against the constant that minimises the errors of p_D and c_D themselves, on a fine grid of constants: the difference
    is of second order in the charge's variation."""
    bath, RT = 0.15, TABLE_1.RT

    def difference(variation):
        mesh = rectangle(1.0, 1.0, 4, 1)
        charge = lambda x, y: 0.2 * (1 + variation * x**2)  # noqa: E731
        at = BathBoundary(mesh, "top", "top")
        cfc = charge(*at.places.T)
        root = np.sqrt(bath**2 + cfc**2 / 4)
        slopes = Slopes(RT * cfc / (2 * root), 0.5 + cfc / (4 * root))
        _, found = sampled(LeastSquares(0, weights), mesh, "top", charge, slopes=slopes)
        constants = np.linspace(cfc.min(), cfc.max(), 200001)[:, None]
        errors = weights[0] * (donnan.pressure(bath, constants, RT) - donnan.pressure(bath, cfc, RT)) ** 2
        errors = errors + weights[1] * (donnan.cations(bath, constants) - donnan.cations(bath, cfc)) ** 2
        return abs(constants[np.argmin(errors @ at.areas), 0] - found[0])

    assert difference(0.4) / difference(0.2) == pytest.approx(4, rel=0.3)


def test_one_dimension_has_one_vertex():
    for rule, wanted in ((InnerLayer(), 0.75), (Averaged(), 1.0), (LeastSquares(), 1.0), (LeastSquares(3), 1.0)):
        assert sampled(rule, column(1.0, 4), "top", lambda x: x)[1] == pytest.approx([wanted], rel=1e-14)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_a_step_prescribes_what_the_rule_gives(order):
    """p and c at the bath of a step with varying charge, also between vertices: InnerLayer looks 0.25 mm below."""
    baths = [Bath("top", c=0.15, treatment=Lagged(InnerLayer()))]
    scene = quarter(material=TABLE_1, model=Concentration(order=order), baths=baths)
    problem = scene.problem
    problem.initialise()
    heights = vertices(problem.mesh)[:, 1]
    problem.vector[problem.ranges["cfc"]][: problem.mesh.nv] = 0.1 + 0.2 * heights
    problem.begin_step(1.0, 1.0)
    problem.vector[:] -= problem.gap()
    mesh, charge = problem.mesh, 0.1 + 0.2 * 0.75
    _, p, c, _ = problem.fields.components
    for x in (0.25, 0.4, 0.5):  # 0.4 lies inside an edge
        point = mesh(x, 1.0)
        assert p(point) == pytest.approx(donnan.pressure(0.15, charge, TABLE_1.RT), rel=1e-12)
        assert c(point) == pytest.approx(donnan.cations(0.15, charge), rel=1e-12)


def test_slopes_are_those_of_the_donnan_condition():
    seen = []

    class Spy:
        def sample(self, charges, boundary, slopes):
            seen.append(slopes)
            return charges[boundary.vertices]

    problem = strip(Lagged(Spy())).problem
    problem.initialise()
    problem.begin_step(1.0, 1.0)
    root = np.sqrt(0.15**2 + 0.01)
    assert seen[0].p == pytest.approx([TABLE_1.RT * 0.2 / (2 * root)] * 2, rel=1e-12)
    assert seen[0].c == pytest.approx([0.5 + 0.2 / (4 * root)] * 2, rel=1e-12)


@pytest.mark.parametrize("rule", [InnerLayer, "inner", 3, CF(1.0)])
def test_what_is_no_rule_is_refused(rule):
    with pytest.raises(InputError, match=r"Lagged: rule .* is none of InnerLayer\(\)"):
        Lagged(rule)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"degree": -1}, "degree -1"),
        ({"degree": 1.5}, "degree 1.5"),
        ({"degree": 7}, "degree 7"),
        ({"weights": (0.0, 0.0)}, "both 0"),
        ({"weights": (-1.0, 1.0)}, "not negative"),
        ({"weights": (1.0, np.inf)}, "finite"),
        ({"weights": (1.0,)}, "two numbers"),
    ],
)
def test_parameters_out_of_range(arguments, words):
    with pytest.raises(InputError, match=words):
        LeastSquares(**arguments)


def test_the_rule_is_described():
    assert "last step, averaged over neighbours" in confined_column(Lagged(Averaged())).describe()
