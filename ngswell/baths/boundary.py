"""The boundary of a bath, as rules that sample charges need it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from ngsolve import BND, H1, VOL, CoefficientFunction, GridFunction, LinearForm, Mesh, ds
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.mesh.points import vertices_of


class BathBoundary:
    """What rules need to know of the boundary of a bath; each piece is found once.

    `baths` are the boundaries of all baths ("a|b"): a vertex off them is an inner one. `weight` is the kinematics' reference
    area per mesh area.
    """

    def __init__(self, mesh: Mesh, boundary: str, baths: str, weight: CoefficientFunction | float = 1.0) -> None:
        self.mesh, self.boundary, self.baths, self.weight = mesh, boundary, baths, weight

    @cached_property
    def vertices(self) -> NDArray:
        """Numbers of its vertices in the mesh, ascending; the order of every other array."""
        return np.array(sorted(vertices_of(self.mesh, self.boundary)))

    @cached_property
    def places(self) -> NDArray:
        """Their reference coordinates [mm], one row each."""
        return np.array([self.mesh.vertices[number].point for number in self.vertices])

    @cached_property
    def areas(self) -> NDArray:
        """The share of the boundary's reference area that belongs to each: the integral of its hat function."""
        hat = self._hats.TestFunction()
        shares = LinearForm(self.weight * hat * ds(definedon=self.mesh.Boundaries(self.boundary))).Assemble()
        return shares.vec.FV().NumPy()[self.vertices].copy()

    @cached_property
    def neighbours(self) -> list[NDArray]:
        """For each, itself and those it shares an edge of the boundary with: positions in `vertices`."""
        position = {number: k for k, number in enumerate(self.vertices)}
        found = [{k} for k in range(len(self.vertices))]
        for element in self.mesh.Boundaries(self.boundary).Elements():
            for edge in element.edges:
                a, b = (position[vertex.nr] for vertex in self.mesh[edge].vertices)
                found[a].add(b)
                found[b].add(a)
        return [np.array(sorted(these)) for these in found]

    @cached_property
    def inner(self) -> list[NDArray]:
        """For each, the inner vertices of the cells that touch it: numbers in the mesh.

        A cell in a corner may have none; then those of the cells around that cell's vertices, and so on.
        """
        on_baths = vertices_of(self.mesh, self.baths)
        if len(on_baths) == self.mesh.nv:
            raise InputError(f"InnerLayer on {self.boundary!r}: every vertex of the mesh lies at a bath; refine the mesh")
        around: list[set[int]] = [set() for _ in range(self.mesh.nv)]
        for cell in self.mesh.Elements(VOL):
            numbers = {vertex.nr for vertex in cell.vertices}
            for number in numbers:
                around[number] |= numbers
        return [np.array(sorted(_nearest_off(number, around, on_baths))) for number in self.vertices]

    def values(self, field: CoefficientFunction) -> NDArray:
        """A field on the boundary, at the vertices (projected on linear functions)."""
        linear = GridFunction(self._hats)
        linear.Set(field, BND, definedon=self.mesh.Boundaries(self.boundary))
        return linear.vec.FV().NumPy()[self.vertices].copy()

    @cached_property
    def _hats(self) -> H1:
        return H1(self.mesh, order=1)


def _nearest_off(number: int, around: list[set[int]], excluded: set[int]) -> set[int]:
    reached = around[number]
    while not reached - excluded:
        wider: set[int] = set().union(*(around[other] for other in reached))
        if wider == reached:
            raise InputError(f"InnerLayer: vertex {number} is connected to no vertex off the baths; refine the mesh")
        reached = wider
    return reached - excluded
