"""Cells that touch without sharing a side, and hinges, are refused by place; every sound mesh passes."""

import numpy as np
import pytest
from netgen.occ import Circle, Glue, OCCGeometry, Rectangle, WorkPlane
from ngsolve import Mesh

from ngswell import InputError, box, check_mesh, column, from_occ, read_mesh, rectangle
from ngswell.mesh.parts import Sides
from tests.meshes import MESHES, gmsh_2d, quarter_disc, write_gmsh


def grid(width, height, shift=(0.0, 0.0), nx=1, ny=1):
    """Nodes and quadrilaterals of a rectangle, from node 1 on."""
    nodes = [(shift[0] + width * i / nx, shift[1] + height * j / ny) for j in range(ny + 1) for i in range(nx + 1)]
    cells = [[1 + i + (nx + 1) * j + n for n in (0, 1, nx + 2, nx + 1)] for j in range(ny) for i in range(nx)]
    return nodes, cells


def block(low, high, cells=(1, 1, 1)):
    """Nodes and hexahedra from one corner to the other, from node 1 on."""
    lines = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells, strict=True)]
    nodes = [(x, y, z) for z in lines[2] for y in lines[1] for x in lines[0]]
    row, layer = cells[0] + 1, (cells[0] + 1) * (cells[1] + 1)
    base = (0, 1, row + 1, row)
    starts = [1 + i + row * j + layer * k for k in range(cells[2]) for j in range(cells[1]) for i in range(cells[0])]
    return nodes, [[start + up + n for up in (0, layer) for n in base] for start in starts]


def together(*pieces, merge=()):
    """Several pieces as one mesh; nodes at the same place in `merge` (all of them for True) become one."""
    nodes, cells, number = [], [], {}
    for places, their_cells in pieces:
        names = []
        for place in places:
            key = place if merge is True or place in merge else (len(nodes), "alone")
            if key not in number:
                nodes.append(place)
                number[key] = len(nodes)
            names.append(number[key])
        cells += [[names[corner - 1] for corner in cell] for cell in their_cells]
    return nodes, cells


def read(tmp_path, nodes, cells):
    """Through a Gmsh file; the first two or four corners of the first cell are its only named side."""
    first = cells[0][: {2: 2, 3: 4}[len(nodes[0])]]
    return read_mesh(write_gmsh_file(tmp_path / "mesh.msh", nodes, cells, first))


def write_gmsh_file(path, nodes, cells, side):
    write_gmsh(path, len(nodes[0]), nodes, cells, {"bottom": [side]})
    return path


UNIT = grid(1.0, 1.0)
SPLIT_RIGHT = grid(1.0, 1.0, (1.0, 0.0), 1, 2)
CRACKED = (grid(1.0, 1.0, (0.0, 0.0), 1, 2), SPLIT_RIGHT)
PRISMS = ([*block((0, 0, 1), (1, 1, 2))[0]], [[1, 2, 4, 5, 6, 8], [1, 4, 3, 5, 8, 7]])
"""Two prisms on top of the unit cube: triangles on its square."""
CROSSED = ([*block((0, 0, 0), (1, 1, 1))[0]], [[1, 2, 3, 5, 6, 7], [2, 4, 3, 6, 8, 7]])
"""Two prisms in the unit cube; the diagonal is the other one."""

FAULTS = {
    "hanging node": (together(UNIT, SPLIT_RIGHT, merge=True), r"\(1, 0.5\) mm .*hanging node.*share whole sides"),
    "interface of duplicates": (together(*CRACKED), r"\(1, (0|0.5|1)\) mm .*two vertices; merge the vertices"),
    "duplicates between shared ends": (
        together(*CRACKED, merge=[(1.0, 0.0), (1.0, 1.0)]), r"\(1, 0.5\) mm .*as along a crack: there are two vertices",
    ),
    "coinciding sides with shared ends": (together(UNIT, grid(1.0, 1.0, (1.0, 0.0)), merge=[(1.0, 0.0)]), r"two vertices"),
    "sides that slide": (together(UNIT, grid(1.0, 1.0, (1.0, 0.7))), r"\(1, (0.7|1)\) mm .*hanging node"),
    "a hanging node, slanted, of six digits": (
        together(([(0, 0), (1, 0), (1.3, 0.7), (0, 1)], [[1, 2, 3, 4]]),
                 ([(1, 0), (2, 0), (2, 0.4), (1.142857, 0.333333)], [[1, 2, 3, 4]]), merge=[(1, 0)]),
        r"\(1.143, 0.3333\) mm .*hanging node",
    ),
    "four hexahedra on one": (
        together(block((0, 0, 0), (1, 1, 1)), block((0, 0, 1), (1, 1, 2), (2, 2, 1)), merge=True), "hanging node",
    ),
    "triangles on a square": (together(block((0, 0, 0), (1, 1, 1)), PRISMS, merge=True), "mm .*their sides differ"),
    "crossed diagonals": (together(CROSSED, PRISMS, merge=True), r", 1\) mm .*their sides differ"),
    "faces of duplicates": (together(block((0, 0, 0), (1, 1, 1)), block((0, 0, 1), (1, 1, 2))), "two vertices"),
    "hinge": (together(UNIT, grid(1.0, 1.0, (1.0, 1.0)), merge=True), r"near \(1, 1\) mm by a corner alone, as by a hinge"),
    "corner of a cube": (
        together(block((0, 0, 0), (1, 1, 1)), block((1, 1, 1), (2, 2, 2)), merge=True),
        r"near \(1, 1, 1\) mm by a corner or an edge alone",
    ),
    "edge of a cube": (
        together(block((0, 0, 0), (1, 1, 1)), block((1, 0, 1), (2, 1, 2)), merge=True), "by a corner or an edge alone",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_refused_by_place(name, tmp_path):
    (nodes, cells), words = FAULTS[name]
    with pytest.raises(InputError, match=words):
        read(tmp_path, nodes, cells)


def disc_with_hole():
    shape = WorkPlane().Circle(2.0).Face() - Circle((0.5, 0.0), 1.0).Face()
    shape.edges.name = "rim"
    return from_occ(shape, 0.8, order=3)


def two_materials():
    """Two squares, glued: the edge between them is in the mesh."""
    left, right = Rectangle(1, 1).Face(), Rectangle(1, 1).Face().Move((1, 0, 0))
    left.edges.name = right.edges.name = "side"
    return Mesh(OCCGeometry(Glue([left, right]), dim=2).GenerateMesh(maxh=0.4))


def refined(times):
    mesh = quarter_disc()
    for _ in range(times):
        mesh.Refine()
    return mesh


SOUND = {
    **{name: make for name, (make, _) in MESHES.items()},
    "boundary layer": lambda tmp: rectangle(1.0, 1.0, 2, 30, grade={"top": 1e6}),
    "slender cells": lambda tmp: rectangle(1.0, 1e-6, 4, 4, triangles=True),
    "corner layer": lambda tmp: box(1.0, 1.0, 1.0, 5, 5, 5, grade={"top": 1e5, "left": 1e3, "front": 10.0}),
    "graded column": lambda tmp: column(1.0, 40, grade={"top": 1e6, "bottom": 1e6}),
    "quarter disc": lambda tmp: quarter_disc(),
    "curved quads": lambda tmp: quarter_disc(order=4, quads=True),
    "refined": lambda tmp: refined(3),
    "hole": lambda tmp: disc_with_hole(),
    "two materials": lambda tmp: two_materials(),
    "apart": lambda tmp: read(tmp, *together(UNIT, grid(1.0, 1.0, (1.0 + 1e-4, 0.0), 1, 2))),
    "conforming pieces": lambda tmp: read(tmp, *together(*CRACKED, merge=True)),
    "conforming hexahedra": lambda tmp: read(
        tmp, *together(block((0, 0, 0), (1, 1, 1)), block((0, 0, 1), (1, 1, 2)), merge=True)
    ),
}


@pytest.mark.parametrize("name", SOUND)
def test_no_false_alarm(name, tmp_path):
    mesh = SOUND[name](tmp_path)
    check_mesh(mesh)
    sides = Sides(mesh)
    cells = {cell.nr: len(cell.facets) for cell in mesh.Elements()}
    assert 2 * len(sides.neighbours) + len(sides.free) == sum(cells.values())
    assert len(sides.parts) == (2 if name == "apart" else 1)


def test_sides_of_a_gmsh_file_without_groups_are_sides_too(tmp_path):
    sides = Sides(read_mesh(gmsh_2d(tmp_path / "a.msh", "mixed")))
    assert sorted(map(len, sides.corners)) == [2] * 6
