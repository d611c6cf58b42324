"""The cells of a body divided among ranks, and its vertices."""

from __future__ import annotations

import numpy as np
from ngsolve import BND, VOL, Mesh
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.team import Team


def check_ranks(team: Team, mesh: Mesh) -> None:
    """Refuse more than one rank for a column, and more ranks than cells. Raises InputError."""
    if team.size > mesh.ne:
        raise InputError(f"ranks: {team.size} ranks for {mesh.ne} cells; start at most as many ranks as there are cells")
    if mesh.dim == 1 and not team.alone:
        raise InputError(f"ranks: {team.size} ranks for a column in 1-d, which one computes in a second; start one rank")


def shares(mesh: Mesh, ranks: int) -> NDArray:
    """The rank of each cell: equal numbers of cells, by bisection of the body across its longest side, again and again."""
    centres = np.array([np.mean([mesh.vertices[v.nr].point for v in cell.vertices], axis=0) for cell in mesh.Elements(VOL)])
    found = np.zeros(mesh.ne, dtype=int)
    _bisect(centres, np.arange(mesh.ne), 0, ranks, found)
    return found


def _bisect(centres: NDArray, cells: NDArray, first: int, ranks: int, found: NDArray) -> None:
    if ranks == 1:
        found[cells] = first
        return
    there = centres[cells]
    along = int(np.argmax(np.ptp(there, axis=0)))
    # Ties, as cells of a regular mesh have, are broken by the cells' numbers: every rank finds the same.
    order = np.argsort(there[:, along].round(9), kind="stable")
    half = ranks // 2
    cut = round(cells.size * half / ranks)
    _bisect(centres, np.sort(cells[order[:cut]]), first, half, found)
    _bisect(centres, np.sort(cells[order[cut:]]), first + half, ranks - half, found)


def shares_of_vertices(mesh: Mesh, of_cells: NDArray) -> NDArray:
    """The rank of each vertex: of those that have a cell there, the one with fewest vertices so far."""
    around: list[set[int]] = [set() for _ in range(mesh.nv)]
    for cell in mesh.Elements(VOL):
        for vertex in cell.vertices:
            around[vertex.nr].add(int(of_cells[cell.nr]))
    taken, found = np.zeros(int(of_cells.max()) + 1, dtype=int), np.zeros(mesh.nv, dtype=int)
    for vertex in sorted(range(mesh.nv), key=lambda vertex: len(around[vertex])):  # first those that one rank has
        found[vertex] = min(sorted(around[vertex]), key=lambda rank: taken[rank])
        taken[found[vertex]] += 1
    return found


def shares_of_sides(mesh: Mesh, of_cells: NDArray) -> NDArray:
    """The rank of each element of the boundaries: that of a cell beside it."""
    return np.array([of_cells[_cell_beside(mesh, side)] for side in mesh.Elements(BND)], dtype=int)


def _cell_beside(mesh: Mesh, side: object) -> int:
    facet = side.faces[0] if mesh.dim == 3 else side.edges[0]  # type: ignore[attr-defined]
    return mesh[facet].elements[0].nr
