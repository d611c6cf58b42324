"""Meshes from Gmsh files, with the names of their physical groups."""

from __future__ import annotations

import re
import warnings
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

import netgen.meshing as netgen
import numpy as np
from ngsolve import Mesh
from numpy.typing import NDArray

from ngswell import checks
from ngswell.calls import in_turn
from ngswell.errors import InputError, place
from ngswell.mesh.shapes import check_named, check_plane
from ngswell.mesh.soundness import check_mesh

_FRAME = {
    "triangle": [1, 2],
    "quad": [1, 3],
    "tetra": [2, 1, 3],
    "hexahedron": [1, 3, 4],
    "wedge": [1, 2, 3],
    "pyramid": [1, 3, 4],
}
"""Corners whose edges from the first corner are right-handed where NGSolve's mapping has a positive determinant."""

_TURNED = {
    "line": [1, 0],
    "triangle": [0, 2, 1],
    "quad": [0, 3, 2, 1],
    "tetra": [0, 2, 1, 3],
    "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5],
    "wedge": [0, 2, 1, 3, 5, 4],
    "pyramid": [0, 3, 2, 1, 4],
}
"""The corners of the same cell, turned over; Gmsh's straight cells by meshio's names."""

_REMEDY = (
    "in Gmsh, set Mesh.MshFileVersion = 4.1, Mesh.ElementOrder = 1, Mesh.SaveAll = 0 (only cells in physical groups), "
    "Mesh.SaveParametric = 0 and save again"
)

Groups = dict[tuple[int, str, str], NDArray]
"""(dimension, shape, name of the physical group) → corners of its cells, one row each."""


@in_turn
def read_mesh(path: str | Path) -> Mesh:
    """Read a 2-d or 3-d mesh in mm from a Gmsh file (.msh, version 2.2 or 4.1) of straight cells. Needs meshio.

    Physical groups of curves (2-d) or surfaces (3-d) name the boundaries, those of the body its materials. Sides without
    a group are sealed and free. Raises InputError for files that cannot be read or meant.
    """
    file = checks.path("read_mesh", path, "body.msh")
    what = f"read_mesh {path}"
    points, groups = _read(what, file)
    dim = max((key[0] for key in groups), default=0)
    if dim < 2:
        raise InputError(f"{what}: there are no cells of 2 or 3 dimensions; a 1-d mesh is made by column()")
    check_named(
        what,
        (name for cell_dim, _, name in groups if cell_dim == dim - 1),
        "give them Physical " + ("Curve" if dim == 2 else "Surface") + '("name") in Gmsh, and one to the body',
    )
    _check_single(what, groups, points)
    sides = {key: cells for key, cells in groups.items() if key[0] == dim - 1 and key[2]}
    body = {key: cells for key, cells in groups.items() if key[0] == dim}
    used = np.unique(np.concatenate([cells.ravel() for cells in body.values()]))
    if dim == 2:
        check_plane(what, points[used, 2])
    row = np.zeros(len(points), dtype=np.int32)
    row[used] = np.arange(len(used))
    inside = _inside(sides, body, points)

    mesh = netgen.Mesh(dim=dim)
    mesh.AddPoints(points[used])
    regions: dict[tuple[int, str], int] = {}
    for (cell_dim, shape, name), cells in (sides | body).items():
        if cell_dim == dim:
            right = np.linalg.det((points[cells[:, _FRAME[shape]]] - points[cells[:, :1]])[..., :dim]) > 0
        else:
            _check_sides(f"{what}: boundary {name!r}", cells, inside, points)
            right = _outward(cells, points, np.array([inside[tuple(sorted(cell))] for cell in cells]), dim)
        # Gmsh's curves and surfaces may face either way.
        corners = row[np.where(right[:, None], cells, cells[:, _TURNED[shape]])]
        if (cell_dim, name) not in regions:
            regions[cell_dim, name] = mesh.AddRegion(name or "default", dim=cell_dim)
        mesh.AddElements(dim=cell_dim, index=regions[cell_dim, name], data=np.ascontiguousarray(corners), base=0)
    result = Mesh(mesh)
    check_mesh(result)
    return result


def _check_single(what: str, groups: Groups, points: NDArray) -> None:
    """Refuse a cell that stands in two physical groups: it would be counted twice."""
    for shape in {key[1] for key in groups}:
        cells = np.concatenate([cells for key, cells in groups.items() if key[1] == shape])
        different, times = np.unique(np.sort(cells), axis=0, return_counts=True)
        if times.max() > 1:
            where = place(points[different[times.argmax()]].mean(axis=0))
            raise InputError(f"{what}: the {shape} near {where} mm is in two physical groups; put each into one")


def _inside(sides: Groups, body: Groups, points: NDArray) -> dict[tuple[int, ...], NDArray]:
    """Centre of a cell behind each side of the body that is in a group, by the side's sorted nodes."""
    by_node: dict[int, list[tuple[int, ...]]] = {}
    for side in (tuple(sorted(side)) for cells in sides.values() for side in cells):
        by_node.setdefault(side[0], []).append(side)
    return {
        side: points[cell].mean(axis=0)
        for cells in body.values()
        for cell in cells
        for node in cell
        for side in by_node.get(node, [])
        if set(side) <= set(cell)
    }


def _check_sides(what: str, sides: NDArray, inside: dict[tuple[int, ...], NDArray], points: NDArray) -> None:
    for side in sides:
        if tuple(sorted(side)) not in inside:
            where = place(points[side[0]])
            raise InputError(f"{what} near {where} mm is no side of the body's cells; is the body in a physical group?")


def _outward(sides: NDArray, points: NDArray, behind: NDArray, dim: int) -> NDArray:
    """Whether NGSolve's normal of each side points away from the point `behind` it."""
    first = points[sides[:, 1]] - points[sides[:, 0]]
    second = np.array([0.0, 0.0, 1.0]) if dim == 2 else points[sides[:, 2]] - points[sides[:, 0]]
    return np.einsum("ij,ij->i", np.cross(first, second), points[sides[:, 0]] - behind) > 0


def _read(what: str, path: Path) -> tuple[NDArray, Groups]:
    """Points, and cells by physical group."""
    try:
        import meshio
    except ImportError as error:
        raise InputError(f"{what}: meshio, which reads Gmsh files, is not installed; pip install ngswell[gmsh]") from error
    if not path.is_file():
        raise InputError(f"{what}: there is no such file")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{what}: the file cannot be read: {error}") from error
    _check_format(what, content)
    try:
        # What meshio prints as a warning is refused above, or is no matter: tags of partitions.
        with redirect_stderr(StringIO()), warnings.catch_warnings():
            warnings.filterwarnings("error", "string or file could not be read")  # numpy's, of words that are no numbers
            file = meshio.gmsh.read(path)
    except (Exception, SystemExit) as error:  # meshio lets through whatever its parsing stumbles over
        reason = f"{type(error).__name__}: {error}".strip(": ")
        raise InputError(f"{what}: the file is not well formed, or meshio cannot read it ({reason}); {_REMEDY}") from error
    curved = sorted({block.type for block in file.cells} - {"vertex", *_TURNED})
    if curved:
        raise InputError(f"{what}: cells {', '.join(curved)} are not straight; {_REMEDY}")
    if any((block.data < 0).any() for block in file.cells):
        raise InputError(f"{what}: cells refer to nodes which the file does not hold")
    return file.points, _groups(what, file, _names(content))


def _check_format(what: str, content: bytes) -> None:
    """Refuse what meshio would misread: version 4.0 as 4.1, and the last cell of a file cut short."""
    start, version, *_ = [*content[:100].split(), b"", b""]
    if start != b"$MeshFormat":
        raise InputError(f"{what}: not a Gmsh mesh; {_REMEDY}")
    if version not in (b"2.2", b"4.1"):
        raise InputError(f"{what}: Gmsh version {version.decode(errors='replace')} is not read, but 2.2 and 4.1; {_REMEDY}")
    if not content.rstrip().rpartition(b"\n")[2].startswith(b"$End"):
        raise InputError(f"{what}: the file is cut short; {_REMEDY}")


def _names(content: bytes) -> dict[tuple[int, int], str]:
    """(dimension, physical number) → name. meshio's field_data keeps one group of each name, Gmsh allows several."""
    lines = content.partition(b"$PhysicalNames")[2].partition(b"$EndPhysicalNames")[0]
    found = re.findall(r'^\s*(\d+)\s+(\d+)\s+"(.*)"', lines.decode(errors="replace"), re.MULTILINE)
    return {(int(dim), int(number)): name for dim, number, name in found}


def _groups(what: str, file: Any, names: dict[tuple[int, int], str]) -> Groups:
    """Cells of the body and its sides by physical group; refuses entities that stand in two."""
    dim = max((block.dim for block in file.cells), default=0)
    tags = file.cell_data.get("gmsh:physical", [np.zeros(len(block), int) for block in file.cells])
    groups: dict[tuple[int, str, str], list[NDArray]] = {}
    for index, (block, numbers) in enumerate(zip(file.cells, tags, strict=True)):
        if block.dim < dim - 1:
            continue
        # Version 4.1 knows groups of whole blocks; of two, the tags hold the first.
        sets = {name for name in file.field_data if len(file.cell_sets.get(name, {index: ()})[index])}
        for number in np.unique(numbers):
            name = names.get((block.dim, abs(number)), "")
            if sets - {name}:
                raise InputError(f"{what}: cells are in two physical groups, {sorted({name, *sets})}; put each into one")
            groups.setdefault((block.dim, block.type, name), []).append(block.data[numbers == number])
    return {key: np.concatenate(cells) for key, cells in groups.items()}
