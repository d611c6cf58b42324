"""Every cell shape: volumes, named boundaries, homogeneous swelling to the closed form; bad meshes refused."""

import sys
from math import cos, pi

import meshio
import numpy as np
import pytest
from netgen.occ import Axes, Box, Glue, WorkPlane, X, Y, Z
from ngsolve import CF, ET, VOL, Integrate, Mesh, specialcf
from ngsolve.meshes import MakeStructured2DMesh

from ngswell import (
    TABLE_2,
    VTK,
    Adaptive,
    Area,
    Axisymmetric,
    Bath,
    Confined,
    Fixed,
    InputError,
    Ledger,
    Newton,
    Penalty,
    PlaneStrain,
    Probe,
    Ramp,
    Roller,
    Scene,
    Solid,
    box,
    check_mesh,
    column,
    from_occ,
    read_mesh,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.plotting import on_deformed_body

# -- meshes of one body, with the sizes of their sides -------------------------------------------------------------------

SIDES_2D = {"bottom": 2.0, "right": 1.0, "top": 2.0, "left": 1.0}  # of 2 × 1 mm
SIDES_3D = {"left": 3.0, "right": 3.0, "front": 6.0, "back": 6.0, "bottom": 2.0, "top": 2.0}  # of 2 × 1 × 3 mm
OUTWARD = {
    "left": (-1, 0, 0),
    "right": (1, 0, 0),
    "front": (0, -1, 0),
    "back": (0, 1, 0),
    "bottom": (0, 0, -1),
    "top": (0, 0, 1),
}


def gmsh_2d(path, kind, version="2.2"):
    """2 × 1 mm as a Gmsh file: triangles, quadrilaterals or both, one turned over; a stray node; sides facing either way."""
    nodes = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (5, 5)]
    left = {"triangle": [[1, 2, 5], [1, 4, 5]], "quad": [[1, 4, 5, 2]], "mixed": [[1, 2, 5], [1, 4, 5]]}[
        kind
    ]  # some clockwise
    right = {"triangle": [[2, 3, 6], [2, 6, 5]], "quad": [[2, 3, 6, 5]], "mixed": [[2, 3, 6, 5]]}[kind]
    sides = {"bottom": [[1, 2], [2, 3]], "right": [[3, 6]], "top": [[4, 5], [5, 6]], "left": [[1, 4]]}
    write_gmsh(path, 2, nodes, left + right, sides, version)
    return path


def gmsh_3d(path, kind, version="2.2"):
    """2 × 1 × 3 mm as a Gmsh file of two hexahedra, four prisms, or one hexahedron and six pyramids."""
    place = {(i, j, k): 1 + i + 3 * j + 6 * k for k in range(2) for j in range(2) for i in range(3)}
    nodes = [(i, j, 3 * k) for i, j, k in place] + [(1.5, 0.5, 1.5)]

    def corners(i):
        return [place[i + a, b, k] for k in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]

    def prisms(i):
        c = corners(i)
        return [[c[n] for n in (0, 1, 2, 4, 5, 6)], [c[n] for n in (0, 2, 3, 4, 6, 7)]]

    def faces(i):
        c = corners(i)
        return [
            [c[n] for n in face]
            for face in ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (3, 2, 6, 7), (0, 3, 7, 4), (1, 2, 6, 5))
        ]

    cells = {
        "hexahedron": [corners(0), corners(1)[4:] + corners(1)[:4]],  # the second upside down
        "prism": prisms(0) + prisms(1),
        "pyramid": [corners(0), *([*face, 13] for face in faces(1))],
    }[kind]
    quads = {
        "left": [faces(0)[4]], "right": [faces(1)[5]],
        "front": [faces(0)[2], faces(1)[2]], "back": [faces(0)[3], faces(1)[3]],
        "bottom": [faces(0)[0], faces(1)[0]], "top": [faces(0)[1], faces(1)[1]],
    }  # fmt: skip
    if kind == "prism":
        for name, shift in (("bottom", 0), ("top", 3)):
            quads[name] = [prism[shift : shift + 3] for prism in cells]
    write_gmsh(path, 3, nodes if kind == "pyramid" else nodes[:-1], cells, quads, version)
    return path


def write_gmsh(path, dim, nodes, cells, sides, version="2.2"):
    names = {name: number for number, name in enumerate([*sides, "gel"], 1)}
    kinds = {(1, 2): 1, (2, 3): 2, (2, 4): 3, (3, 4): 4, (3, 8): 5, (3, 6): 6, (3, 5): 7}
    groups = [(dim - 1, name, side) for name, group in sides.items() for side in group] + [(dim, "gel", c) for c in cells]
    lines = ["$MeshFormat", f"{version} 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{dim - (name != "gel")} {number} "{name}"' for name, number in names.items()] + ["$EndPhysicalNames"]
    points = [f"{' '.join(str(v) for v in (*node, 0, 0)[:3])}" for node in nodes]
    if version == "2.2":
        lines += ["$Nodes", str(len(nodes)), *(f"{n} {point}" for n, point in enumerate(points, 1)), "$EndNodes"]
        lines += ["$Elements", str(len(groups))]
        for number, (d, name, cell) in enumerate(groups, 1):
            lines.append(" ".join(str(w) for w in (number, kinds[d, len(cell)], 2, names[name], names[name], *cell)))
    else:
        entities = {2: [0, len(sides), 1, 0], 3: [0, 0, len(sides), 1]}[dim]
        lines += [
            "$Entities",
            " ".join(map(str, entities)),
            *(f"{n} 0 0 0 1 1 1 1 {n} 0" for n in names.values()),
            "$EndEntities",
        ]
        lines += ["$Nodes", f"1 {len(nodes)} 1 {len(nodes)}", f"{dim} 1 0 {len(nodes)}"]
        lines += [str(n) for n in range(1, len(nodes) + 1)] + points + ["$EndNodes"]
        lines += ["$Elements", f"{len(groups)} {len(groups)} 1 {len(groups)}"]
        for number, (d, name, cell) in enumerate(groups, 1):
            lines += [f"{d} {names[name]} {kinds[d, len(cell)]} 1", " ".join(map(str, (number, *cell)))]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def occ_rectangle(**options):
    shape = WorkPlane().Rectangle(2, 1).Face()
    for name, side in (("left", X), ("right", -X), ("bottom", Y), ("top", -Y)):
        shape.edges.Min(side).name = name
    return from_occ(shape, 1.0, **options)


def occ_box():
    shape = Box((0, 0, 0), (2, 1, 3))
    for name, side in (("left", X), ("right", -X), ("front", Y), ("back", -Y), ("bottom", Z), ("top", -Z)):
        shape.faces.Min(side).name = name
    return from_occ(shape, 3.0)


def quarter_disc(maxh=0.6, order=2, **options):
    """Of radius 1 mm, in the first quadrant."""
    shape = WorkPlane().MoveTo(0, 0).Line(1).Rotate(90).Arc(1, 90).Rotate(90).Line(1).Face()
    shape.edges.name = "rim"
    shape.edges.Min(X).name = "left"
    shape.edges.Min(Y).name = "bottom"
    return from_occ(shape, maxh, order, **options)


GRADE_3D = {"top": 3.0, "bottom": 2.0, "left": 2.0}
MESHES = {
    "segments": (lambda tmp: column(2.0, 3, grade={"top": 4.0}), {ET.SEGM}),
    "quads": (lambda tmp: rectangle(2.0, 1.0, 2, 2, grade={"left": 4.0, "top": 3.0}), {ET.QUAD}),
    "triangles": (lambda tmp: rectangle(2.0, 1.0, 2, 1, triangles=True), {ET.TRIG}),
    "occ triangles": (lambda tmp: occ_rectangle(), {ET.TRIG}),
    "occ quads": (lambda tmp: occ_rectangle(quads=True), {ET.QUAD}),
    "gmsh triangles": (lambda tmp: read_mesh(gmsh_2d(tmp / "a.msh", "triangle")), {ET.TRIG}),
    "gmsh quads": (lambda tmp: read_mesh(gmsh_2d(tmp / "a.msh", "quad")), {ET.QUAD}),
    "gmsh mixed": (lambda tmp: read_mesh(gmsh_2d(tmp / "a.msh", "mixed", "4.1")), {ET.TRIG, ET.QUAD}),
    "hexahedra": (lambda tmp: box(2.0, 1.0, 3.0, 1, 1, 2, grade=GRADE_3D), {ET.HEX}),
    "prisms": (lambda tmp: box(2.0, 1.0, 3.0, 1, 1, 2, "prisms", grade=GRADE_3D), {ET.PRISM}),
    "tetrahedra": (lambda tmp: box(2.0, 1.0, 3.0, 1, 1, 1, "tetrahedra"), {ET.TET}),
    "occ tetrahedra": (lambda tmp: occ_box(), {ET.TET}),
    "gmsh hexahedra": (lambda tmp: read_mesh(gmsh_3d(tmp / "a.msh", "hexahedron")), {ET.HEX}),
    "gmsh prisms": (lambda tmp: read_mesh(gmsh_3d(tmp / "a.msh", "prism", "4.1")), {ET.PRISM}),
    "gmsh pyramids": (lambda tmp: read_mesh(gmsh_3d(tmp / "a.msh", "pyramid")), {ET.HEX, ET.PYRAMID}),
}


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


# -- grading -----------------------------------------------------------------------------------------------------------


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


def test_ungraded_is_uniform():
    assert lengths(column(3.0, 5)) == pytest.approx(0.6, rel=1e-12)
    assert lengths(column(3.0, 1, grade={"top": 10.0})) == pytest.approx(3.0)


# -- homogeneous swelling ------------------------------------------------------------------------------------------------


def swell(mesh, kinematics, supports, boundary, observers=()):
    """A homogeneous body of Table 2 whose charge comes up in a bath of 4.1 mol/l, to rest."""
    scene = Scene(
        mesh=mesh,
        kinematics=kinematics,
        material=TABLE_2,
        supports=supports,
        baths=[Bath(boundary, c=4.1, treatment=Penalty(40.0))],
        charge=Ramp((0, 0.0), (100, 1.0)),
    )
    point = {1: (0.7,), 2: (0.4, 0.3), 3: (0.4, 0.3, 0.2)}[mesh.dim]
    volume, probe, ledger = Area(), Probe(point, "J", "p", "cfc", "c_plus", "nS"), Ledger()
    scene.run(1e6, Adaptive(1e-4), [volume, probe, ledger, *observers], newton=Newton())
    return scene, volume.values, probe.values, ledger


def check_at_rest(volume, values, ledger, motion):
    state = homogeneous_equilibrium(TABLE_2, 4.1, motion)
    assert volume[-1] / volume[0] == pytest.approx(state.J, rel=1e-8)
    for name, value in (("J", state.J), ("p", state.p), ("cfc", state.cfc), ("c_plus", state.c), ("nS", state.nS)):
        # A homogeneous state lies in every space: what is left is the relaxation still to come.
        assert values[name][-1] == pytest.approx(value, rel=1e-7)
    # Contents and fluxes are sums over the same test functions: what is left is round-off of p times penalty times step,
    # which grows to 1e-8 in steps of 1e5 s. While the body takes up fluid, within 200 s, it is below 1e-11.
    early = ledger.time <= 200
    for held, left in ((ledger.fluid, ledger.fluid_left), (ledger.cations, ledger.cations_left)):
        (left,) = left.values()
        assert np.abs(held - held[0] + left)[early].max() < 1e-11 * held.max()
        assert np.abs(held - held[0])[early].max() > 1e-3 * held.max()
    return state


@pytest.mark.parametrize("name", MESHES)
def test_swelling_comes_to_the_closed_form(name, tmp_path):
    mesh = MESHES[name][0](tmp_path)
    kinematics, supports, boundary, motion = {
        1: (Confined(), [Roller("bottom", "x")], "top", "confined"),
        2: (PlaneStrain(), [Roller("left", "x"), Roller("bottom", "y")], "top|right", "plane strain"),
        3: (Solid(), [Roller("left", "x"), Roller("front", "y"), Roller("bottom", "z")], "top|right|back", "3-d"),
    }[mesh.dim]
    _, volume, values, ledger = swell(mesh, kinematics, supports, boundary)
    check_at_rest(volume, values, ledger, motion)


@pytest.mark.parametrize("quads", [False, True])
def test_curved_quarter_disc_in_plane_strain(quads):
    mesh = quarter_disc(quads=quads)
    supports = [Roller("left", "x"), Roller("bottom", "y")]
    _, volume, values, ledger = swell(mesh, PlaneStrain(), supports, "rim")
    # Sides curved with the displacement's order: coordinates, and their multiples, lie in its space.
    check_at_rest(volume, values, ledger, "plane strain")


@pytest.mark.parametrize("name", ["quarter disc", "quads", "triangles", "gmsh mixed"])
def test_axisymmetric(name, tmp_path):
    mesh = quarter_disc() if name == "quarter disc" else MESHES[name][0](tmp_path)
    boundary = "rim" if name == "quarter disc" else "top|right"
    _, volume, values, ledger = swell(mesh, Axisymmetric(), [Roller("left", "r"), Roller("bottom", "z")], boundary)
    check_at_rest(volume, values, ledger, "3-d")
    exact = 2 * pi / 3 if name == "quarter disc" else 4 * pi
    # The hemisphere within its sides' error, the cylinder exactly.
    assert volume[0] == pytest.approx(exact, rel=2e-3 if name == "quarter disc" else 1e-12)


@pytest.mark.parametrize("kind", ["3-d", "axisymmetric", "plane strain"])
def test_vtk_reads_back(kind, tmp_path):
    if kind == "3-d":
        mesh, kinematics = box(2.0, 1.0, 3.0, 1, 1, 1, "prisms"), Solid()
        supports, boundary = [Roller("left", "x"), Roller("front", "y"), Roller("bottom", "z")], "top|right|back"
    else:
        mesh, kinematics = quarter_disc(quads=True), Axisymmetric() if kind == "axisymmetric" else PlaneStrain()
        x, y = kinematics.directions
        supports, boundary = [Roller("left", x), Roller("bottom", y)], "rim"
    series = VTK(tmp_path / "body", when=[0.0, 1e6])
    swell(mesh, kinematics, supports, boundary, [series])
    state = homogeneous_equilibrium(TABLE_2, 4.1, "plane strain" if kind == "plane strain" else "3-d")
    files = sorted(tmp_path.glob("body*.vtu"), key=lambda file: file.stat().st_mtime_ns)
    assert len(files) == 2
    data = meshio.read(files[-1])
    fields = data.point_data
    assert all(np.isfinite(values).all() for values in fields.values())
    # Written in double precision: what is left is the relaxation still to come.
    assert fields["J"] == pytest.approx(state.J, rel=1e-9)
    assert fields["p"] == pytest.approx(state.p, rel=1e-9)
    stretch = state.J ** (1 / (2 if kind == "plane strain" else 3))
    assert fields["displacement"] == pytest.approx((stretch - 1) * data.points, abs=1e-9)
    assert data.points[:, 2].max() == (3.0 if kind == "3-d" else 0.0)


@pytest.mark.parametrize("name", ["quads", "triangles", "gmsh mixed", "quarter disc"])
def test_picture_of_the_deformed_body(name, tmp_path):
    mesh = quarter_disc() if name == "quarter disc" else MESHES[name][0](tmp_path)
    boundary = "rim" if name == "quarter disc" else "top|right"
    scene = Scene(
        mesh=mesh, kinematics=PlaneStrain(), material=TABLE_2, supports=[Roller("left", "x"), Roller("bottom", "y")],
        baths=[Bath(boundary, c=4.1)],
    )  # fmt: skip
    scene.run(1.0, Fixed(1.0))
    scene.problem.fields.components[0].Set((0.1 * CF(1), 0.2 * CF(1)))
    picture = on_deformed_body(scene.problem, CF(3.0), cuts=4)
    corners = np.stack([picture.mesh.x, picture.mesh.y], 1)[picture.mesh.triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum() / 2
    # The pieces cover the body, up to what their straight sides cut off the rim: chords of at least 12 pieces a quarter.
    exact = pi / 4 if name == "quarter disc" else 2.0
    assert area == pytest.approx(exact, rel=(1 - cos(pi / 24)) if name == "quarter disc" else 1e-12)
    assert picture.outlines.shape == (mesh.ne, 17, 2)
    assert picture.outlines[:, 0] == pytest.approx(picture.outlines[:, -1])
    # Outlines enclose the cells: their shoelace area is the body's.
    x, y = picture.outlines[..., 0], picture.outlines[..., 1]
    enclosed = np.abs((x[:, :-1] * y[:, 1:] - x[:, 1:] * y[:, :-1]).sum(axis=1)).sum() / 2
    assert enclosed == pytest.approx(area, rel=1e-12)


# -- refusals ------------------------------------------------------------------------------------------------------------


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
        (lambda: rectangle(1.0, 1.0, 3, 3, grade={"top": float("nan")}), "grade at 'top' = nan"),
        (lambda: from_occ(WorkPlane().Circle(1.0).Face(), 0.5), "no boundary has a name.*edges"),
        (lambda: from_occ(Box((0, 0, 0), (1, 1, 1)), 0.5), "no boundary has a name.*faces"),
        (lambda: from_occ(named_disc(), 0.0), "maxh"),
        (lambda: from_occ(named_disc(), 0.5, order=0), "order"),
        (lambda: from_occ(named_disc().Move((0, 0, 1)), 0.5), "z = 1 mm"),
        (lambda: from_occ(named_disc().edges[0], 0.5), "neither a solid nor a face"),
        (lambda: from_occ(named_box(), 0.5, quads=True), "quads"),
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


def test_two_materials_of_one_shape():
    left, right = WorkPlane().Rectangle(1, 1).Face(), WorkPlane().MoveTo(1, 0).Rectangle(1, 1).Face()
    left.name, right.name, left.edges.name, right.edges.name = "soft", "hard", "rim", "rim"
    mesh = from_occ(Glue([left, right]), 0.5)
    for name in ("soft", "hard"):
        assert Integrate(CF(1.0), mesh.Materials(name)) == pytest.approx(1.0, rel=1e-12)


def moved(mesh, number, place):
    """The same mesh with one point moved."""
    points = mesh.ngmesh.Coordinates()
    points[number, : len(place)] = place
    return Mesh(mesh.ngmesh)


@pytest.mark.parametrize(
    ("mesh", "number", "place", "words"),
    [
        (lambda: column(1.0, 4), 1, (0.9,), r"cell 1, a segment near \(0.7\) mm, is turned inside out"),
        (lambda: column(1.0, 4), 1, (0.0,), r"cell 0, a segment near \(0\) mm, has no size"),
        (lambda: rectangle(1.0, 1.0, 3, 3), 5, (0.9, 0.9), "cell .*, a quadrilateral near .* turned inside out"),
        # The corner at (0.77, 0.77) has more than 180°; all integration points of the forms still lie in the sound part.
        (lambda: rectangle(1.0, 1.0, 2, 2), 4, (0.77, 0.77), "a quadrilateral near .* has a corner of 180° or more: move"),
        (lambda: rectangle(1.0, 1.0, 3, 3, triangles=True), 5, (0.9, 0.9), "a triangle near .* turned inside out"),
        (lambda: rectangle(1.0, 1.0, 1, 1, triangles=True), 3, (0.5, 0.5), "cell 1, a triangle near .* no size"),
        (lambda: box(1.0, 1.0, 1.0, 2, 2, 2), 13, (1.4, 1.4, 1.4), "a hexahedron near .* turned inside out, as 6 more"),
        (lambda: box(1.0, 1.0, 1.0, 2, 2, 2, "prisms"), 13, (1.4, 1.4, 1.4), "a prism near .* turned inside out"),
        (lambda: box(1.0, 1.0, 1.0, 2, 2, 2, "tetrahedra"), 13, (1.4, 1.4, 1.4), "a tetrahedron near .* turned inside out"),
    ],
)
def test_bad_cells_are_refused_by_number_and_place(mesh, number, place, words):
    sound = mesh()
    check_mesh(sound)
    with pytest.raises(InputError, match=words):
        check_mesh(moved(sound, number, place))


def test_scenes_check_their_mesh():
    mesh = moved(rectangle(1.0, 1.0, 3, 3), 5, (0.9, 0.9))
    with pytest.raises(InputError, match="turned inside out"):
        Scene(
            mesh=mesh,
            kinematics=PlaneStrain(),
            material=TABLE_2,
            supports=[Roller("bottom", "xy")],
            baths=[Bath("top", c=1.0)],
        )


def test_thin_cells_are_sound():
    # A boundary layer of 1e-8 of the body is thin, not without size; nor does numbering the other way round do harm.
    check_mesh(rectangle(1.0, 1.0, 2, 30, grade={"top": 1e6}))
    check_mesh(moved(column(1.0, 2), 1, (1 - 1e-8,)))
    check_mesh(moved(rectangle(1.0, 1.0, 1, 2, triangles=True), 2, (0.0, 1e-8)))
    check_mesh(MakeStructured2DMesh(nx=2, ny=2, mapping=lambda s, t: (-s, t)))


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda text: text.replace("2.2 0 8", "4 0 8"), "version 4 .*4.1"),
        (lambda text: text.replace("2.2 0 8", "2.2 1 8"), "not well formed.*save again"),  # text that calls itself binary
        (lambda text: "solid\n" + text[40:], "not a Gmsh mesh"),
        (lambda text: text[: len(text) // 2], "cut short"),
        (lambda text: text[: text.index("\n$EndElements") - 1], "cut short"),  # within the last cell
        (lambda text: text.replace("\n7 5 5 0\n", "\n"), "not well formed"),
        (lambda text: text.replace("\n7 5 5 0\n", "\n7 5 5 o\n"), "not well formed"),
        (
            lambda text: text.replace("$PhysicalNames", "$Names").replace("$EndPhysicalNames", "$EndNames"),
            "no boundary has a name",
        ),
        (lambda text: text.replace("1 1 2 1 1 1 2", "1 8 2 1 1 1 2 3"), "not straight.*ElementOrder"),
        (lambda text: text.replace("1 1 2 1 1 1 2", "1 1 2 1 1 1 6"), "'bottom' near .* no side"),
        (lambda text: text.replace("2 1 2 1 1 2 3", "2 1 2 1 1 2 1"), r"line near \(0.5, 0, 0\) mm .* two physical groups"),
        (lambda text: text.replace("5 1 1 0", "5 1 1 0.5"), "z = 0.5 mm"),
        (lambda text: text.replace("2 1 2 1 1 2 3", "2 1 2 1 1 2 9"), "not well formed"),
        (
            lambda text: text.replace("\n7 5 5 0\n", "\n10 5 5 0\n").replace("2 1 2 1 1 2 3", "2 1 2 1 1 2 9"),
            "does not hold",
        ),
        (lambda text: text.replace("5 1 1 0", "5 2.5 -0.5 0"), "turned inside out"),
    ],
)
def test_bad_gmsh_files(edit, words, tmp_path):
    path = gmsh_2d(tmp_path / "a.msh", "quad")
    text = path.read_text()
    assert edit(text) != text
    path.write_text(edit(text))
    with pytest.raises(InputError, match=words):
        read_mesh(path)


def test_gmsh_files_that_are_none(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_mesh(tmp_path / "none.msh")
    (tmp_path / "a.msh").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="not a Gmsh mesh"):
        read_mesh(tmp_path / "a.msh")
    write_gmsh(tmp_path / "b.msh", 1, [(0,), (1,)], [[1, 2]], {})
    with pytest.raises(InputError, match="column"):
        read_mesh(tmp_path / "b.msh")


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_gmsh_file_of_another_program(version, binary, tmp_path, capsys):
    points = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)], dtype=float)
    cells = [("line", np.array([[0, 1], [1, 2]])), ("line", np.array([[2, 3], [3, 0]])), ("quad", np.array([[0, 1, 2, 3]]))]
    mesh = meshio.Mesh(points, cells)
    tags = [np.array([1, 1]), np.array([2, 2]), np.array([3])]
    mesh.cell_data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    mesh.field_data = {"floor and right": np.array([1, 1]), "rest": np.array([2, 1]), "gel": np.array([3, 2])}
    mesh.point_data = {"gmsh:dim_tags": np.array([(1, 1), (1, 1), (1, 2), (2, 3)])}
    meshio.gmsh.write(tmp_path / "a.msh", mesh, version, binary=binary)
    capsys.readouterr()
    got = read_mesh(tmp_path / "a.msh")
    assert capsys.readouterr() == ("", "")
    assert set(got.GetBoundaries()) == {"floor and right", "rest"}
    assert got.GetMaterials() == ("gel",)
    assert Integrate(CF(1.0), got, definedon=got.Boundaries("rest")) == pytest.approx(3.0, rel=1e-12)
    assert Integrate(CF(1.0), got) == pytest.approx(2.0, rel=1e-12)
    content = (tmp_path / "a.msh").read_bytes()
    (tmp_path / "a.msh").write_bytes(content[: content.index(b"$EndElements") - 8])
    with pytest.raises(InputError, match="cut short"):
        read_mesh(tmp_path / "a.msh")


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_gmsh_groups_of_one_name_and_of_none(version, tmp_path):
    # Two groups of curves and the body share a name; the group of the left side has none and is sealed and free.
    path = gmsh_2d(tmp_path / "a.msh", "quad", version)
    text = path.read_text().replace('"gel"', '"top"').replace('"right"', '"top"').replace('1 4 "left"\n', "")
    path.write_text(text.replace("$PhysicalNames\n5", "$PhysicalNames\n4"))
    mesh = read_mesh(path)
    assert set(mesh.GetBoundaries()) - {"default"} == {"bottom", "top"}
    assert mesh.GetMaterials() == ("top",)
    assert Integrate(CF(1.0), mesh, definedon=mesh.Boundaries("top")) == pytest.approx(3.0, rel=1e-12)


def test_gmsh_entities_in_two_groups_or_none(tmp_path):
    path = gmsh_2d(tmp_path / "a.msh", "quad", "4.1")
    text = path.read_text()
    assert "\n1 0 0 0 1 1 1 1 1 0\n" in text
    for groups in ("2 1 3", "2 3 1", "2 9 1"):  # the last: an unnamed group in front
        path.write_text(text.replace("\n1 0 0 0 1 1 1 1 1 0\n", f"\n1 0 0 0 1 1 1 {groups} 0\n"))
        with pytest.raises(InputError, match=r"two physical groups.*'bottom'"):
            read_mesh(path)
    # Saved without its group, beside others with theirs: meshio cannot tell which is which.
    path.write_text(text.replace("\n1 0 0 0 1 1 1 1 1 0\n", "\n1 0 0 0 1 1 1 0 0\n"))
    with pytest.raises(InputError, match="SaveAll = 0"):
        read_mesh(path)
    # Turned over by Gmsh: the same group.
    path.write_text(text.replace("\n1 0 0 0 1 1 1 1 1 0\n", "\n1 0 0 0 1 1 1 1 -1 0\n"))
    assert "bottom" in read_mesh(path).GetBoundaries()


def test_gmsh_files_need_meshio(tmp_path, monkeypatch):
    path = gmsh_2d(tmp_path / "a.msh", "quad")
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(InputError, match=r"pip install ngswell\[gmsh\]"):
        read_mesh(path)


def test_stray_nodes_are_left_out(tmp_path):
    # Nodes of no cell would be vertices without an equation.
    assert read_mesh(gmsh_2d(tmp_path / "a.msh", "quad")).nv == 6
