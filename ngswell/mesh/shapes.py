"""Meshes with named boundaries and regions: structured and graded, from CAD shapes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from math import prod
from typing import Any

import numpy as np
from netgen.occ import OCCGeometry, TopoDS_Shape
from ngsolve import Mesh
from ngsolve.meshes import Make1DMesh, MakeStructured2DMesh, MakeStructured3DMesh
from numpy.typing import NDArray

from ngswell import checks
from ngswell.calls import in_turn
from ngswell.errors import InputError
from ngswell.mesh.soundness import check_mesh
from ngswell.mesh.spacing import Grade, Lines, Regions, coordinates, places, thinnings, with_regions

SIZES = (1e-6, 1e6)
"""Sizes that a body may have [mm]."""

MOST_CELLS = 10**7
"""Cells that a mesh may have."""

MOST_THINNING = 100.0
"""Ratio that `grade` may have on a shape, whose thin cells are thin in all directions."""


@in_turn
def column(
    height: float,
    cells: int,
    grade: Grade | None = None,
    lines: Lines | None = None,
    regions: Regions | None = None,
) -> Mesh:
    """A segment of `height` [mm] with boundaries "bottom" (x = 0) and "top".

    `grade={"top": 10}` thins the cells in a geometric progression: the one at the top has a tenth of the length of the
    largest, at the bottom. Towards both ends, the largest is in the middle.

    `lines={"x": 0.3}` or `{"x": [0.3, 0.8]}` shifts the cells so that mesh lines lie there [mm]: where baths or materials
    bend or jump within a cell, no order helps. `regions={"x": ["core", "skin"]}` names what lies between them, from x = 0
    upwards, for `by_region`.
    """
    (height,), (cells,) = _checked_sizes("column", (height,), (cells,))
    at = places("column", lines, "x")
    (nodes,) = coordinates("column", (height,), (cells,), (("bottom", "top"),), grade, at)
    mesh = Make1DMesh(cells, mapping=lambda s: nodes[round(cells * s)])
    for number, name in enumerate(("bottom", "top")):
        mesh.ngmesh.SetBCName(number, name)
    return with_regions("column", mesh, at, regions)


@in_turn
def ray(
    inner: float,
    outer: float,
    cells: int,
    grade: Grade | None = None,
    lines: Lines | None = None,
    regions: Regions | None = None,
) -> Mesh:
    """A segment of radii from `inner`, which may be 0, to `outer` [mm], with boundaries "inner" and "outer".

    For `Cylindrical` and `Spherical`. `grade={"outer": 10}` thins the cells towards a boundary, `lines={"r": 0.8}` puts mesh
    lines at radii and `regions={"r": ["core", "shell"]}` names what lies between them, as in `column`.
    """
    inner = checks.number("ray: inner", inner, "mm", 0.0, SIZES[1], "radii start at the centre")
    (outer,), (cells,) = _checked_sizes("ray", (outer,), (cells,))
    if not outer > inner:
        raise InputError(f"ray: outer = {outer:g} mm has to be larger than inner = {inner:g} mm")
    at = places("ray", lines, "r")
    (nodes,) = coordinates("ray", (outer - inner,), (cells,), (("inner", "outer"),), grade, at, "r", inner)
    mesh = Make1DMesh(cells, mapping=lambda s: nodes[round(cells * s)])
    for number, name in enumerate(("inner", "outer")):
        mesh.ngmesh.SetBCName(number, name)
    return with_regions("ray", mesh, at, regions, "r")


@in_turn
def rectangle(
    width: float,
    height: float,
    nx: int,
    ny: int,
    triangles: bool = False,
    grade: Grade | None = None,
    lines: Lines | None = None,
    regions: Regions | None = None,
) -> Mesh:
    """Cells on [0, width] × [0, height] [mm] with boundaries "bottom", "right", "top", "left".

    Quadrilaterals, or `triangles`, two in each. `grade` thins the cells towards boundaries, as in `column`.
    `lines={"x": 0.3, "y": [0.5, 0.8]}` puts mesh lines there and `regions={"y": ["core", "middle", "skin"]}` names what lies
    between those of one axis, as in `column`.
    """
    (width, height), (nx, ny) = _checked_sizes("rectangle", (width, height), (nx, ny))
    checks.flag("rectangle: triangles", triangles)
    sides = (("left", "right"), ("bottom", "top"))
    at = places("rectangle", lines, "xy")
    xs, ys = coordinates("rectangle", (width, height), (nx, ny), sides, grade, at)
    mesh = MakeStructured2DMesh(
        quads=not triangles, nx=nx, ny=ny, mapping=lambda s, t: (xs[round(nx * s)], ys[round(ny * t)])
    )
    return with_regions("rectangle", mesh, at, regions)


@in_turn
def box(
    width: float,
    depth: float,
    height: float,
    nx: int,
    ny: int,
    nz: int,
    cells: str = "hexahedra",
    grade: Grade | None = None,
    lines: Lines | None = None,
    regions: Regions | None = None,
) -> Mesh:
    """Cells on [0, width] × [0, depth] × [0, height] [mm].

    Boundaries: "left" (x = 0) and "right", "front" (y = 0) and "back", "bottom" (z = 0) and "top". `cells` are "hexahedra",
    or two "prisms" (triangles in x and y, extruded in z) or six "tetrahedra" in each. `grade`, `lines` and `regions` as in
    `rectangle`.
    """
    checks.choice("box: cells", cells, ("hexahedra", "prisms", "tetrahedra"))
    (width, depth, height), (nx, ny, nz) = _checked_sizes("box", (width, depth, height), (nx, ny, nz))
    sides = (("left", "right"), ("front", "back"), ("bottom", "top"))
    at = places("box", lines, "xyz")
    xs, ys, zs = coordinates("box", (width, depth, height), (nx, ny, nz), sides, grade, at)
    mesh = MakeStructured3DMesh(
        hexes=cells == "hexahedra",
        prism=cells == "prisms",
        nx=nx,
        ny=ny,
        nz=nz,
        mapping=lambda r, s, t: (xs[round(nx * r)], ys[round(ny * s)], zs[round(nz * t)]),
    )
    # NGSolve looks along x and counts the sides x = 0, y = 0, x = width, y = depth, z = 0, z = height.
    for number, name in enumerate(("left", "front", "right", "back", "bottom", "top")):
        mesh.ngmesh.SetBCName(number, name)
    return with_regions("box", mesh, at, regions)


@in_turn
def from_occ(shape: Any, maxh: float, order: int = 1, quads: bool = False, grade: Grade | None = None) -> Mesh:
    """Mesh a shape of `netgen.occ` in mm: a face in the plane z = 0 with named edges, or a solid with named faces.

    `maxh` is the largest cell size [mm]; the cells follow curved sides with polynomials of `order`, best the
    displacement's. `quads` meshes a face with quadrilaterals where it can, with triangles where it cannot. Unnamed sides
    are sealed and free. `grade={"rim": 10}` asks for cells a tenth of `maxh` at the sides of that name; they are thin in all
    directions, so that their number grows with the ratio, on a solid with its square.

        disc = WorkPlane().Circle(2.0).Face()
        disc.edges.name = "rim"
        mesh = from_occ(disc, maxh=0.5, order=2)
    """
    maxh = checks.positive("from_occ: maxh", maxh, "mm")
    order = checks.integer("from_occ: order of the curved sides", order, 1, 10)
    checks.flag("from_occ: quads", quads)
    checks.instance("from_occ: shape", shape, TopoDS_Shape, "a shape of netgen.occ, such as Rectangle(1.0, 2.0).Face()")
    solid = len(shape.solids) > 0
    if solid and quads:
        raise InputError("from_occ: a solid is meshed with tetrahedra; quads is for faces")
    if not solid and not len(shape.faces):
        raise InputError("from_occ: the shape has neither a solid nor a face")
    sides = "faces" if solid else "edges"
    names = [side.name or "" for side in getattr(shape, sides)]
    check_named("from_occ", names, f"name some of the shape's {sides}, shape.{sides}.name = 'rim'")
    if not solid:
        check_plane("from_occ", np.array([vertex.p[2] for vertex in shape.vertices]))
    thin = thinnings("from_occ", grade, sorted({*names} - {""}), MOST_THINNING)
    with _thinned(getattr(shape, sides), maxh, thin):
        geometry = OCCGeometry(shape) if solid else OCCGeometry(shape, dim=2)
        mesh = Mesh(geometry.GenerateMesh(maxh=maxh, quad_dominated=quads))
    mesh.Curve(order)
    check_mesh(mesh)
    return mesh


@contextmanager
def _thinned(sides: Iterable[Any], maxh: float, thin: dict[str, float]) -> Iterator[None]:
    """Largest cells [mm] at sides of a shape, by their names, for the time being: the shape is the caller's."""
    before = [(side, side.maxh) for side in sides if side.name in thin]
    try:
        for side, own in before:
            side.maxh = min(own, maxh / thin[side.name])
        yield
    finally:
        for side, own in before:
            side.maxh = own


def check_named(what: str, names: Iterable[str], remedy: str) -> None:
    """Refuse a mesh none of whose boundaries has a name: supports and baths could not find them."""
    if not set(names) - {"", "default"}:
        raise InputError(f"{what}: no boundary has a name; {remedy}")


def check_plane(what: str, heights: NDArray) -> None:
    """Refuse a 2-d body outside the plane z = 0; `heights` are the z of its corners [mm]."""
    highest = heights[np.abs(heights).argmax()]
    if abs(highest) > 1e-9:
        raise InputError(f"{what}: a 2-d body lies in the plane z = 0, this one reaches z = {highest:g} mm")


def _checked_sizes(what: str, sizes: tuple[float, ...], cells: tuple[int, ...]) -> tuple[list[float], list[int]]:
    """Sizes [mm] as floats and numbers of cells as ints, neither beyond what a body can mean or a memory can hold."""
    lengths = [checks.number(f"{what}: size", size, "mm", *SIZES) for size in sizes]
    numbers = [checks.integer(f"{what}: number of cells", number, 1, MOST_CELLS) for number in cells]
    if prod(numbers) > MOST_CELLS:
        raise InputError(f"{what}: {' × '.join(map(str, numbers))} cells are more than {MOST_CELLS}; take fewer")
    return lengths, numbers
