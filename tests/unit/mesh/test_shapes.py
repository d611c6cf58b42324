"""Every cell shape: volumes, named boundaries, grading; sizes and shapes that are refused."""

from math import pi

import numpy as np
import pytest
from netgen.occ import Axes, Box, Glue, WorkPlane, Z
from ngsolve import CF, ET, VOL, Integrate, specialcf, x

from ngswell import InputError, box, column, from_occ, rectangle
from tests.meshes import MESHES, OUTWARD, SIDES_2D, SIDES_3D, quarter_disc


@pytest.mark.parametrize("name", MESHES)
def test_volume_and_boundaries(name, tmp_path):
    make, shapes = MESHES[name]
    mesh = make(tmp_path)
    assert {element.type for element in mesh.Elements(VOL)} >= shapes  # Netgen may leave triangles between quadrilaterals
    sides = {1: {"bottom": 1.0, "top": 1.0}, 2: SIDES_2D, 3: SIDES_3D}[mesh.dim]
    assert set(mesh.GetBoundaries()) == set(sides)
    # Polynomials on straight cells: exact to round-off; NGSolve keeps the rational functions of pyramids 1e-10 off the tip.
    exact = 1e-9 if ET.PYRAMID in shapes else 1e-12
    assert Integrate(CF(1.0), mesh) == pytest.approx({1: 2.0, 2: 2.0, 3: 6.0}[mesh.dim], rel=exact)
    for side, size in sides.items():
        assert Integrate(CF(1.0), mesh, definedon=mesh.Boundaries(side)) == pytest.approx(size, rel=1e-12)
        if mesh.dim > 1:
            outward = OUTWARD[side] if mesh.dim == 3 else (*OUTWARD[side][:1], OUTWARD[side][2])
            flux = Integrate(specialcf.normal(mesh.dim), mesh, definedon=mesh.Boundaries(side))
            assert np.array(flux) == pytest.approx(size * np.array(outward), abs=1e-12)


def test_boundaries_lie_where_their_names_say():
    mesh = column(2.0, 3)
    ends = {e.mat: mesh[e.vertices[0]].point[0] for e in mesh.Boundaries(".*").Elements()}
    assert ends == {"bottom": 0.0, "top": 2.0}


def test_quarter_disc_is_curved():
    areas = [Integrate(CF(1.0), quarter_disc(0.6, order)) for order in (1, 2, 3)]
    straight = quarter_disc(0.6, 1)
    ends = [[straight[v].point for v in side.vertices] for side in straight.Boundaries("rim").Elements()]
    # Straight sides: the polygon of chords. Curved: each order of the sides takes away more of its error.
    assert areas[0] == pytest.approx(sum(abs(a[0] * b[1] - a[1] * b[0]) for a, b in ends) / 2, rel=1e-12)
    errors = np.abs(np.array(areas) / (pi / 4) - 1)
    assert errors[1] < errors[0] / 10
    assert errors[2] < errors[1]
    mesh = quarter_disc(0.6, 3)
    assert Integrate(CF(1.0), mesh, definedon=mesh.Boundaries("left|bottom")) == pytest.approx(2.0, rel=1e-12)


def test_curved_sides_converge():
    # Between an arc and its parabola lies an area of h⁵ for each of 1/h sides; 0.1 for what is not yet asymptotic.
    meshes = [quarter_disc(h, 2) for h in (0.4, 0.2, 0.1)]
    errors = [abs(Integrate(CF(1.0), mesh) / (pi / 4) - 1) for mesh in meshes]
    sides = [sum(1 for _ in mesh.Boundaries("rim").Elements()) for mesh in meshes]
    orders = np.diff(np.log(errors)) / -np.diff(np.log(sides))
    assert min(orders) > 3.9


def lengths(mesh):
    return np.diff(sorted(vertex.point[0] for vertex in mesh.vertices))


@pytest.mark.parametrize("cells", [2, 7, 8])
def test_grade_is_the_ratio_of_largest_to_smallest(cells):
    one = lengths(column(3.0, cells, grade={"top": 10.0}))
    assert one.max() / one[-1] == pytest.approx(10.0, rel=1e-12)
    assert one[1:] / one[:-1] == pytest.approx(10.0 ** (-1 / (cells - 1)), rel=1e-9)  # a geometric progression
    assert lengths(column(3.0, cells, grade={"bottom": 10.0})) == pytest.approx(one[::-1], rel=1e-9)
    assert one.sum() == pytest.approx(3.0, rel=1e-14)


@pytest.mark.parametrize("cells", [7, 8])
def test_grade_towards_both_ends(cells):
    both = lengths(column(3.0, cells, grade={"top": 10.0, "bottom": 4.0}))
    assert both.max() / both[[0, -1]] == pytest.approx([4.0, 10.0], rel=1e-12)
    assert np.argmax(both) in ((cells - 1) // 2, cells // 2)
    even = lengths(column(3.0, cells, grade={"top": 10.0, "bottom": 10.0}))
    assert even == pytest.approx(even[::-1], rel=1e-9)


@pytest.mark.parametrize(("nx", "ny"), [(2, 2), (7, 4), (8, 12)])
def test_lines_lie_where_asked(nx, ny):
    mesh = rectangle(1.1, 1.0, nx, ny, grade={"left": 6.0, "top": 6.0}, lines={"x": 0.3, "y": 0.8})
    xs, ys = (np.unique(np.round([v.point[axis] for v in mesh.vertices], 12)) for axis in (0, 1))
    assert (len(xs), len(ys)) == (nx + 1, ny + 1)
    assert 0.3 in xs
    assert 0.8 in ys
    assert (xs[0], xs[-1], ys[0], ys[-1]) == (0.0, 1.1, 0.0, 1.0)


@pytest.mark.parametrize("cells", [4, 9, 20])
@pytest.mark.parametrize("grade", [None, {"top": 30.0}])
def test_several_lines_lie_where_asked(cells, grade):
    for at in ([0.05, 0.1, 0.9], [0.8, 0.81, 0.82], [0.9, 0.1, 0.5]):  # crowded, too, and in any order
        nodes = sorted(vertex.point[0] for vertex in column(1.0, cells, grade, {"x": at}).vertices)
        assert len(nodes) == cells + 1
        assert set(at) <= set(nodes)
        assert (np.diff(nodes) > 0).all()


@pytest.mark.parametrize(
    "make",
    [
        lambda **more: column(1.0, 6, **more),
        lambda **more: rectangle(1.0, 1.0, 6, 2, **more),
        lambda **more: rectangle(1.0, 1.0, 6, 2, triangles=True, **more),
        lambda **more: box(1.0, 1.0, 1.0, 6, 1, 2, **more),
        lambda **more: box(1.0, 1.0, 1.0, 6, 1, 2, "prisms", **more),
        lambda **more: box(1.0, 1.0, 1.0, 6, 1, 2, "tetrahedra", **more),
    ],
)
def test_regions_lie_between_lines(make):
    mesh = make(lines={"x": [0.9, 0.15]}, regions={"x": iter(["skin", "core", "skin"])})
    assert sorted(mesh.GetMaterials()) == ["core", "skin"]
    assert set(mesh.GetBoundaries()) == set(make().GetBoundaries())
    core = mesh.MaterialCF({"core": 1.0}, default=0.0)
    # Polynomials on straight cells: exact to round-off.
    assert Integrate(core, mesh) == pytest.approx(0.75, rel=1e-12)
    assert Integrate(core * x, mesh) == pytest.approx((0.9**2 - 0.15**2) / 2, rel=1e-12)


def test_ungraded_is_uniform():
    assert lengths(column(3.0, 5)) == pytest.approx(0.6, rel=1e-12)
    assert lengths(column(3.0, 1, grade={"top": 10.0})) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: column(1.0, 2.5), "cells 2.5 is not a whole number"),
        (lambda: rectangle(float("inf"), 1.0, 1, 1), "finite"),
        (lambda: box(1.0, -1.0, 1.0, 1, 1, 1), "size = -1 mm is outside"),
        (lambda: box(1.0, 1.0, 1.0, 1, 0, 1), "cells 0 is not a whole number"),
        (lambda: box(1.0, 1.0, 1.0, 1, 1, 1, cells="hexes"), "'hexes'.*hexahedra"),
        (lambda: column(1.0, 3, grade={"left": 2.0}), "'left'.*'bottom', 'top'"),
        (lambda: rectangle(1.0, 1.0, 3, 3, grade={"top": 0.5}), "grade at 'top' = 0.5 is outside"),
        (lambda: rectangle(1.0, 1.0, 3, 3, lines={"z": 0.5}), "'z' is none of 'x', 'y'"),
        (lambda: rectangle(1.0, 1.0, 3, 3, lines={"x": 1.5}), "1.5.*between 0 and 1"),
        (lambda: rectangle(1.0, 1.0, 1, 3, lines={"x": 0.5}), "two cells"),
        (lambda: column(1.0, 3, lines={"x": [0.5, 0.5]}), "different places"),
        (lambda: column(1.0, 3, lines={"x": [0.2, 0.5, 0.7]}), "one more than lines"),
        (lambda: column(1.0, 3, lines={"y": 0.5}), "'y' is none of 'x'"),
        (lambda: column(1.0, 3, lines={"x": 0.5}, regions={"x": ["a"]}), "a list of 2 names in x"),
        (lambda: column(1.0, 3, regions={"x": "a"}), "a list of 1 names in x"),
        (lambda: column(1.0, 3, lines={"x": 0.5}, regions={"x": ["a", 2]}), "a name .* got 2"),
        (lambda: rectangle(1.0, 1.0, 3, 3, regions={"x": ["a"], "y": ["b"]}), "along one axis"),
        (lambda: rectangle(1.0, 1.0, 3, 3, regions={"z": ["a"]}), "'z' is none of 'x', 'y'"),
        (lambda: rectangle(1.0, 1.0, 3, 3, grade={"top": float("nan")}), "grade at 'top' = nan"),
        (lambda: from_occ(WorkPlane().Circle(1.0).Face(), 0.5), "no boundary has a name.*edges"),
        (lambda: from_occ(Box((0, 0, 0), (1, 1, 1)), 0.5), "no boundary has a name.*faces"),
        (lambda: from_occ(named_disc(), 0.0), "maxh"),
        (lambda: from_occ(named_disc(), 0.5, order=0), "order"),
        (lambda: from_occ(named_disc().Move((0, 0, 1)), 0.5), "z = 1 mm"),
        (lambda: from_occ(named_disc().edges[0], 0.5), "neither a solid nor a face"),
        (lambda: from_occ(named_box(), 0.5, quads=True), "quads"),
        (lambda: from_occ(named_disc(), 0.5, grade={"top": 3}), "'top' is none of 'rim'"),
        (lambda: from_occ(named_disc(), 0.5, grade={"rim": 1e3}), "grade at 'rim' = 1000 is outside 1 … 100"),
        (lambda: from_occ(named_disc(), 0.5, grade=3), "grade has to be a dictionary"),
    ],
)
def test_bad_sizes_and_shapes(make, words):
    with pytest.raises(InputError, match=words):
        make()


def named_disc():
    disc = WorkPlane(Axes((0, 0, 0), n=Z)).Circle(1.0).Face()
    disc.edges.name = "rim"
    return disc


def named_box():
    shape = Box((0, 0, 0), (1, 1, 1))
    shape.faces.name = "side"
    return shape


@pytest.mark.parametrize(("make", "quads"), [(named_disc, False), (named_disc, True), (named_box, False)])
def test_cells_of_a_shape_are_thinned_at_its_sides(make, quads):
    shape, side = make(), "rim" if make is named_disc else "top"
    if side == "top":
        shape.faces.Max(Z).name = "top"

    def at_side(mesh):
        sides = [np.array([mesh[vertex].point for vertex in e.vertices]) for e in mesh.Boundaries(side).Elements()]
        return max(np.linalg.norm(corners[0] - corners[1]) for corners in sides)

    plain, thin = from_occ(shape, 0.5, quads=quads), from_occ(shape, 0.5, quads=quads, grade={side: 5})
    assert at_side(plain) > 0.3
    assert at_side(thin) < 2 * 0.1
    largest = max(np.ptp([thin[v].point for v in e.vertices], axis=0).max() for e in thin.Elements(VOL))
    assert largest > 0.25  # inside they stay large
    assert from_occ(shape, 0.5, quads=quads).ne == plain.ne  # the shape is as it was


def test_two_materials_of_one_shape():
    left, right = WorkPlane().Rectangle(1, 1).Face(), WorkPlane().MoveTo(1, 0).Rectangle(1, 1).Face()
    left.name, right.name, left.edges.name, right.edges.name = "soft", "hard", "rim", "rim"
    mesh = from_occ(Glue([left, right]), 0.5)
    for name in ("soft", "hard"):
        assert Integrate(CF(1.0), mesh.Materials(name)) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rectangle(1.0, -1.0, 2, 2), "size = -1 mm is outside"),
        (lambda: column(1.0, 0), "cells 0 is not a whole number"),
        (lambda: column("a", 3), "size has to be a number"),
        (lambda: column(1.0, True), "cells True"),
        (lambda: column(1e-300, 3), "1e-300 mm is outside"),
        (lambda: column(1.0, 10**9), "cells 1000000000"),
        (lambda: column(1.0, 3, grade=["top"]), "grade has to be a dictionary"),
        (lambda: rectangle(1.0, 1.0, 3, 3, lines={"x": "a"}), "line in x .* got 'a'"),
        (lambda: rectangle(1.0, 1.0, 1, 1, triangles="no"), "True or False, got 'no'"),
    ],
)
def test_bad_numbers(make, words):
    with pytest.raises(InputError, match=words):
        make()
