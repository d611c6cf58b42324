"""Where the lines of structured meshes lie: graded, through given places; names of the regions between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import log
from typing import Any

import numpy as np
from ngsolve import Mesh

from ngswell import checks
from ngswell.errors import InputError

Grade = dict[str, float]
"""Boundary name → how many times thinner the cell at that boundary is than the largest of its row [-]."""

Lines = Mapping[str, float | Sequence[float]]
"""Axis, "x", "y" or "z" → places [mm] at which mesh lines lie: one, or several in any order."""

Regions = Mapping[str, Sequence[str]]
"""One axis → names of the regions between its lines, from 0 upwards; a name may come back."""


def places(what: str, lines: Lines | None, axes: str) -> dict[str, list[float]]:
    """Places [mm] of the lines along each of the `axes` that has some, ascending."""
    found = {}
    for axis, given in _by_name(f"{what}: lines", lines, {"x": 0.3}):
        checks.choice(f"{what}: lines: axis", axis, axes)
        several = checks.as_tuple(given)
        numbers = [checks.number(f"{what}: line in {axis}", at, "mm") for at in ((given,) if several is None else several)]
        found[axis] = sorted(numbers)
    return found


def coordinates(
    what: str,
    sizes: tuple[float, ...],
    cells: tuple[int, ...],
    sides: tuple[tuple[str, str], ...],
    grade: Grade | None,
    lines: dict[str, list[float]],
    axes: str = "xyz",
    start: float = 0.0,
) -> list[list[float]]:
    """Node coordinates [mm] along each of the `axes` from `start`; their two ends are named in `sides`."""
    names = [name for pair in sides for name in pair]
    ratios = dict.fromkeys(names, 1.0) | thinnings(what, grade, names, 1e6)
    nodes = {
        axis: _nodes(start, size, number, ratios[low], ratios[high])
        for axis, size, number, (low, high) in zip(axes, sizes, cells, sides, strict=False)
    }
    for axis, at in lines.items():
        nodes[axis] = _through(f"{what}: lines", axis, nodes[axis], at)
    return list(nodes.values())


def thinnings(what: str, grade: Grade | None, names: list[str], most: float) -> dict[str, float]:
    """How many times thinner cells are at the boundaries that `grade` names, from 1 to `most`."""
    found = {}
    for name, ratio in _by_name(f"{what}: grade", grade, {names[-1]: 10.0}):
        checks.choice(f"{what}: grade: boundary", name, names)
        hint = "it is largest over smallest cell"
        found[name] = checks.number(f"{what}: grade at {name!r}", ratio, low=1.0, high=most, hint=hint)
    return found


def with_regions(what: str, mesh: Mesh, lines: dict[str, list[float]], regions: Regions | None, axes: str = "xyz") -> Mesh:
    """The mesh with the cells between `lines` in the named regions; without names as it is."""
    named = _by_name(f"{what}: regions", regions, {"x": ["core", "skin"]})
    if not named:
        return mesh
    if len(named) > 1:
        raise InputError(f"{what}: regions = {checks.short(regions)}: name the regions along one axis")
    axis, names = named[0][0], checks.as_tuple(named[0][1])
    checks.choice(f"{what}: regions: axis", axis, axes[: mesh.dim])
    at = lines.get(axis, [])
    if names is None or len(names) != len(at) + 1:
        raise InputError(
            f"{what}: regions = {checks.short(regions)} has to have a list of {len(at) + 1} names in {axis}, one more than "
            "its lines"
        )
    for name in names:
        checks.name(f"{what}: regions: a name", name, "skin")
    ngmesh, numbers = mesh.ngmesh, _numbers(mesh, list(dict.fromkeys(names)))
    for cell in {1: ngmesh.Elements1D, 2: ngmesh.Elements2D, 3: ngmesh.Elements3D}[mesh.dim]():
        vertices = cell.points if mesh.dim == 1 else cell.vertices
        middle = sum(ngmesh[vertex].p[axes.index(axis)] for vertex in vertices) / len(vertices)
        cell.index = numbers[names[int(np.searchsorted(at, middle))]]
    return Mesh(ngmesh)


def _numbers(mesh: Mesh, names: list[str]) -> dict[str, int]:
    """New regions of the mesh, by name; the first is the one that all cells are in."""
    ngmesh = mesh.ngmesh
    first = 0 if mesh.dim == 3 else 1  # in 3-d NGSolve's own has no number
    if first:
        ngmesh.SetMaterial(1, names[0])
    added = {name: ngmesh.AddRegion(name, dim=mesh.dim) for name in names[first:]}
    return {**dict.fromkeys(names[:first], 1), **added}


def _by_name(what: str, values: Any, example: dict[str, Any]) -> list[tuple[Any, Any]]:
    """The entries of a dictionary, none for None."""
    if values is None:
        return []
    if not isinstance(values, dict):
        raise InputError(f"{what} has to be a dictionary, such as {example}, got {checks.short(values)}")
    return list(values.items())


def _through(what: str, axis: str, nodes: list[float], at: list[float]) -> list[float]:
    """Nodes with those nearest to the places `at` moved there, stretched evenly between them."""
    start, end, cells, moved = nodes[0], nodes[-1], len(nodes) - 1, [nodes[0], *at, nodes[-1]]
    if not (np.diff(moved) > 0).all() or len(at) >= cells:
        raise InputError(
            f"{what} = {{{axis!r}: {checks.short(at)}}} mm need two cells or more in {axis}, one more than lines, and "
            f"different places between {start:g} and {end:g}"
        )
    number = np.abs(np.array(nodes)[:, None] - np.array(at)).argmin(axis=0)
    count = np.arange(len(at))
    number = np.maximum.accumulate(np.maximum(number, 1 + count) - count) + count  # one node for each, in their order
    number = np.minimum(number, cells - len(at) + count)
    return np.interp(nodes, [start, *np.array(nodes)[number], end], moved).tolist()


def _nodes(start: float, length: float, cells: int, low: float, high: float) -> list[float]:
    """Nodes of `cells` cells from `start` on, thinned `low` and `high` times at the ends, in geometric progressions."""
    index = np.arange(cells)
    both = low > 1 and high > 1
    reach = max(1, (cells - 1) // 2 if both else cells - 1)  # cells from an end to the largest
    thinning = log(low) * np.maximum(0, 1 - index / reach) + log(high) * np.maximum(0, 1 - (cells - 1 - index) / reach)
    nodes = np.concatenate([[0.0], np.cumsum(np.exp(-thinning))])
    return [*(start + length * nodes[:-1] / nodes[-1]), start + length]
