"""Meshes from Gmsh files, with the names of their physical groups."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import netgen.meshing as netgen
import numpy as np
from ngsolve import Mesh
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.meshes import check_mesh, check_named, check_plane

_DIMENSION = {15: 0, 1: 1, 2: 2, 3: 2, 4: 3, 5: 3, 6: 3, 7: 3}
"""Gmsh's straight cells: point, segment, triangle, quadrilateral, tetrahedron, hexahedron, prism, pyramid."""

_FRAME = {2: [1, 2], 3: [1, 3], 4: [2, 1, 3], 5: [1, 3, 4], 6: [1, 2, 3], 7: [1, 3, 4]}
"""Corners whose edges from the first corner are right-handed where NGSolve's mapping has a positive determinant."""

_TURNED = {
    1: [1, 0],
    2: [0, 2, 1],
    3: [0, 3, 2, 1],
    4: [0, 2, 1, 3],
    5: [0, 3, 2, 1, 4, 7, 6, 5],
    6: [0, 2, 1, 3, 5, 4],
    7: [0, 3, 2, 1, 4],
}
"""The corners of the same cell, turned over."""

Groups = dict[tuple[int, int], list[list[int]]]
"""(type of cell, physical number) → corner numbers of its cells."""


@dataclass(frozen=True)
class _File:
    names: dict[tuple[int, int], str]  # (dimension, physical number) → name
    nodes: dict[int, list[float]]
    cells: Groups


def read_mesh(path: str | Path) -> Mesh:
    """Read a 2-d or 3-d mesh in mm from a Gmsh file (.msh, text, version 2.2 or 4.1) of straight cells.

    Physical groups of curves (2-d) or surfaces (3-d) name the boundaries, those of the body its materials. Sides without
    a group are sealed and free. Raises InputError for files that cannot be read or meant.
    """
    what = f"read_mesh {path}"
    file = _parse(what, Path(path))
    dim = max((_DIMENSION[kind] for kind, _ in file.cells), default=0)
    if dim < 2:
        raise InputError(f"{what}: there are no cells of 2 or 3 dimensions; a 1-d mesh is made by column()")
    wanted = {key: cells for key, cells in file.cells.items() if _DIMENSION[key[0]] >= dim - 1}
    names = {key: file.names.get((_DIMENSION[key[0]], key[1]), "") for key in wanted}
    check_named(
        what,
        (name for (kind, _), name in names.items() if _DIMENSION[kind] == dim - 1),
        "give them Physical " + ("Curve" if dim == 2 else "Surface") + '("name") in Gmsh, and one to the body',
    )
    _check_single(what, wanted)
    numbers = sorted({node for (kind, _), cells in wanted.items() if _DIMENSION[kind] == dim for c in cells for node in c})
    points = np.array([file.nodes[number] for number in numbers])
    if dim == 2:
        check_plane(what, points[:, 2])
    row = {number: index for index, number in enumerate(numbers)}
    inside = _inside(wanted, dim, file.nodes)

    mesh = netgen.Mesh(dim=dim)
    mesh.AddPoints(points)
    regions: dict[tuple[int, str], int] = {}
    for (kind, group), cells in sorted(wanted.items()):
        cell_dim, name = _DIMENSION[kind], names[kind, group]
        if cell_dim < dim and not name:
            continue
        if cell_dim < dim:
            _check_sides(f"{what}: boundary {name!r}", cells, inside, file.nodes)
        corners = np.array([[row[node] for node in cell] for cell in cells], dtype=np.int32)
        if cell_dim == dim:
            right = _right_handed(kind, corners, points[:, :dim])
        else:
            right = _outward(corners, points, np.array([inside[tuple(sorted(cell))] for cell in cells]), dim)
        # Gmsh's curves and surfaces may face either way.
        corners = np.where(right[:, None], corners, corners[:, _TURNED[kind]])
        if (cell_dim, name) not in regions:
            regions[cell_dim, name] = mesh.AddRegion(name or "default", dim=cell_dim)
        mesh.AddElements(dim=cell_dim, index=regions[cell_dim, name], data=np.ascontiguousarray(corners), base=0)
    result = Mesh(mesh)
    check_mesh(result)
    return result


def _check_single(what: str, groups: Groups) -> None:
    """Refuse a cell that stands in two physical groups: it would be counted twice."""
    seen: set[tuple[int, ...]] = set()
    for cells in groups.values():
        for cell in cells:
            key = tuple(sorted(cell))
            if key in seen:
                raise InputError(f"{what}: the cell of nodes {cell} is in two physical groups; put each into one")
            seen.add(key)


def _inside(groups: Groups, dim: int, nodes: dict[int, list[float]]) -> dict[tuple[int, ...], NDArray]:
    """Centre of a cell behind each side of the body that is in a group, by the side's sorted nodes."""
    sides = {tuple(sorted(cell)) for (kind, _), cells in groups.items() if _DIMENSION[kind] < dim for cell in cells}
    by_node: dict[int, list[tuple[int, ...]]] = {}
    for side in sides:
        by_node.setdefault(side[0], []).append(side)
    inside = {}
    for (kind, _), cells in groups.items():
        for cell in cells if _DIMENSION[kind] == dim else []:
            for side in (side for node in cell for side in by_node.get(node, [])):
                if set(side) <= set(cell):
                    inside[side] = np.mean([nodes[node] for node in cell], axis=0)
    return inside


def _check_sides(
    what: str, sides: list[list[int]], inside: dict[tuple[int, ...], NDArray], nodes: dict[int, list[float]]
) -> None:
    for side in sides:
        if tuple(sorted(side)) not in inside:
            place = ", ".join(f"{x:.4g}" for x in nodes[side[0]])
            raise InputError(f"{what} near ({place}) mm is no side of the body's cells; is the body in a physical group?")


def _right_handed(kind: int, corners: NDArray, points: NDArray) -> NDArray:
    return np.linalg.det(points[corners[:, _FRAME[kind]]] - points[corners[:, :1]]) > 0


def _outward(sides: NDArray, points: NDArray, behind: NDArray, dim: int) -> NDArray:
    """Whether NGSolve's normal of each side points away from the point `behind` it."""
    first = points[sides[:, 1]] - points[sides[:, 0]]
    second = np.array([0.0, 0.0, 1.0]) if dim == 2 else points[sides[:, 2]] - points[sides[:, 0]]
    return np.einsum("ij,ij->i", np.cross(first, second), points[sides[:, 0]] - behind) > 0


# -- the file ----------------------------------------------------------------------------------------------------------


def _parse(what: str, path: Path) -> _File:
    if not path.is_file():
        raise InputError(f"{what}: there is no such file")
    remedy = "in Gmsh, set Mesh.MshFileVersion = 4.1, Mesh.Binary = 0, Mesh.ElementOrder = 1"
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{what}: the file cannot be read: {error}") from error
    try:
        start, header = text.split("\n", 2)[:2]
        version, binary = header.split()[:2]
    except ValueError as error:
        raise InputError(f"{what}: not a Gmsh mesh; {remedy}") from error
    if start.strip() != "$MeshFormat":
        raise InputError(f"{what}: not a Gmsh mesh; {remedy}")
    if version not in _READERS or binary != "0":
        kind = "binary" if binary != "0" else "text"
        raise InputError(f"{what}: Gmsh version {version} ({kind}) is not read, but 2.2 and 4.1 as text; {remedy}")
    try:
        sections, names = _sections(text), {}
        for line in sections.get("PhysicalNames", ["0"])[1:]:
            dim, number, name = line.split(maxsplit=2)
            names[int(dim), int(number)] = name.strip().strip('"')
        nodes, cells = _READERS[version](sections)
    except (KeyError, IndexError, ValueError, StopIteration) as error:
        raise InputError(f"{what}: the file is cut short or not well formed ({error}); {remedy}") from error
    missing = {node for group in cells.values() for cell in group for node in cell} - set(nodes)
    if missing:
        raise InputError(f"{what}: cells refer to node {min(missing)}, which the file does not hold")
    curved = {kind for kind, _ in cells if kind not in _DIMENSION}
    if curved:
        raise InputError(f"{what}: cells of Gmsh's type {sorted(curved)} are not straight; {remedy}")
    return _File(names, nodes, cells)


def _sections(text: str) -> dict[str, list[str]]:
    """Lines of each $Name … $EndName."""
    sections: dict[str, list[str]] = {}
    name = None
    for line in text.splitlines():
        if line.startswith("$End"):
            if name != line[4:].strip():
                raise ValueError(f"${name} is not closed")
            name = None
        elif line.startswith("$"):
            name = line[1:].strip()
            sections[name] = []
        elif name is not None and line.strip():
            sections[name].append(line)
    if name is not None:
        raise ValueError(f"${name} is not closed")
    return sections


def _version_2(sections: dict[str, list[str]]) -> tuple[dict[int, list[float]], Groups]:
    nodes, cells = {}, Groups()
    lines = iter(sections["Nodes"])
    for _ in range(int(next(lines))):
        number, *place = next(lines).split()
        nodes[int(number)] = [float(x) for x in place]
    lines = iter(sections["Elements"])
    for _ in range(int(next(lines))):
        _, kind, tags, *rest = (int(word) for word in next(lines).split())
        cells.setdefault((kind, rest[0] if tags else 0), []).append(rest[tags:])
    return nodes, cells


def _version_4(sections: dict[str, list[str]]) -> tuple[dict[int, list[float]], Groups]:
    """Nodes and cells stand in blocks, one for each geometric entity, and entities have physical numbers."""
    groups: dict[tuple[int, int], list[int]] = {}
    lines = iter(sections["Entities"])
    for dimension, entities in enumerate(next(lines).split()):
        for _ in range(int(entities)):
            entity, *rest = next(lines).split()
            rest = rest[3 if dimension == 0 else 6 :]  # after a point, or the corners of a bounding box
            groups[dimension, int(entity)] = [abs(int(word)) for word in rest[1 : 1 + int(rest[0])]]
    nodes, cells = {}, Groups()
    lines = iter(sections["Nodes"])
    for _ in range(int(next(lines).split()[0])):
        numbers = [int(next(lines)) for _ in range(int(next(lines).split()[3]))]
        for number in numbers:
            nodes[number] = [float(x) for x in next(lines).split()[:3]]
    lines = iter(sections["Elements"])
    for _ in range(int(next(lines).split()[0])):
        dim, tag, kind, count = (int(word) for word in next(lines).split())
        block = [[int(word) for word in next(lines).split()[1:]] for _ in range(count)]
        for group in groups.get((dim, tag)) or [0]:
            cells.setdefault((kind, group), []).extend(block)
    return nodes, cells


_READERS = {"2.2": _version_2, "4.1": _version_4}
