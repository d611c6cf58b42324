"""Where a lagged bath takes its charge from: the remedies for its oscillation that Ehlers and Acartürk list, p. 546.

A rule turns the charges of the last step at the vertices of the mesh into charges at the vertices of a bath's boundary; the
bath prescribes p_D and c_D with these. Between vertices the sampled charge is linear, whatever the order of the fields.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from ngsolve import BND, H1, VOL, CoefficientFunction, GridFunction, LinearForm, Mesh, ds
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError
from ngswell.mesh.points import vertices_of


class Slopes(NamedTuple):
    """How the prescribed values follow the charge, at the vertices of a bath's boundary."""

    p: NDArray  # dp_D/dcfc [N/mm² per mol/l]
    c: NDArray  # dc_D/dcfc [-]


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


@runtime_checkable
class SamplingRule(Protocol):
    """Where `Lagged(rule)` takes the charge from."""

    def sample(self, charges: NDArray, boundary: BathBoundary, slopes: Slopes) -> NDArray:
        """Charges at the bath's vertices [mol/l] from those at all vertices of the mesh."""
        ...


@dataclass(frozen=True)
class InnerLayer:
    """The charge of the inner layer of cells: at a vertex of the boundary, the mean over those vertices of the cells
    touching it that lie at no bath. In one dimension that is the neighbour.

    The paper's second remedy, its reference [1]. The sample is taken one cell away, so p_D and c_D carry an error of first
    order in the cell size wherever the charge varies across the boundary.
    """

    def __str__(self) -> str:
        return "from the inner layer of cells"

    def sample(self, charges: NDArray, boundary: BathBoundary, slopes: Slopes) -> NDArray:
        return np.array([charges[inner].mean() for inner in boundary.inner])


@dataclass(frozen=True)
class Averaged:
    """The mean of the charge at the vertex and at its neighbours along the bath's boundary: the paper's third remedy.

    In one dimension the vertex itself. The reach is one cell, so that it shrinks with the mesh. Of a saw-tooth, +1, −1, +1,
    the mean over three leaves −1/3.
    """

    def __str__(self) -> str:
        return "averaged over neighbours on the boundary"

    def sample(self, charges: NDArray, boundary: BathBoundary, slopes: Slopes) -> NDArray:
        on_boundary = charges[boundary.vertices]
        return np.array([on_boundary[neighbours].mean() for neighbours in boundary.neighbours])


@dataclass(frozen=True)
class LeastSquares:
    """A polynomial along the boundary of a bath, fitted to the charge by weighted least squares: the paper's first remedy.

    After Snijders et al., as the paper reports it: the error of p and c at the boundary is minimised, weighted with factors.
    Over the polynomials q of `degree` in the reference coordinates,

        Σ_i A_i { w_p [p_D(q_i) − p_D(cfc_i)]² + w_c [c_D(q_i) − c_D(cfc_i)]² } → min,

    A_i being the vertices' areas and `weights` = (w_p, w_c) [mm⁴/N², l²/mol²]. The differences are linearised about cfc_i,
    which leaves linear least squares with the weights A_i [w_p (dp_D/dcfc)² + w_c (dc_D/dcfc)²]: both errors are of one
    function, so the factors only shift weight between vertices of different charge or bath. One polynomial for each `Bath`,
    round its corners too; sides with a `Bath` each are fitted apart.

    The default `degree` 0 is the one that leaves no mode along the boundary to grow: the degree 1 already reproduces the
    tilt, the mode of a strip one cell wide. It is also the crudest: a charge that varies along the bath needs a higher
    degree, at the price of the modes that this degree carries.
    """

    degree: int = 0
    weights: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        checks.settle(self, degree=checks.whole("LeastSquares: degree", self.degree, 0, 6))
        weights = checks.vector("LeastSquares: weights", self.weights, 1e12, "mm⁴/N² or l²/mol²")
        if len(weights) != 2:
            raise InputError(f"LeastSquares: weights {weights!r} have to be two numbers, (for p, for c)")
        if min(weights) < 0 or not any(weights):
            raise InputError(f"LeastSquares: weights {weights!r} have to be finite, not negative, and not both 0")
        checks.settle(self, weights=weights)

    def __str__(self) -> str:
        return f"by a polynomial of degree {self.degree} along the bath (least squares)"

    def sample(self, charges: NDArray, boundary: BathBoundary, slopes: Slopes) -> NDArray:
        for_p, for_c = self.weights
        weights = boundary.areas * (for_p * slopes.p**2 + for_c * slopes.c**2)
        if not weights.any():  # without charge p_D has no slope
            weights = boundary.areas
        roots = np.sqrt(weights)
        shapes = _monomials(boundary.places, self.degree)
        # The fitted values are unique, the coefficients are not: on a straight side the coordinates depend on each other.
        fit = np.linalg.lstsq(roots[:, None] * shapes, roots * charges[boundary.vertices], rcond=1e-10)[0]
        return shapes @ fit


def _monomials(places: NDArray, degree: int) -> NDArray:
    """All products of up to `degree` coordinates, one column each; coordinates shifted and scaled to ±1."""
    middle = (places.max(axis=0) + places.min(axis=0)) / 2
    local = (places - middle) / (float(np.ptp(places, axis=0).max()) / 2 or 1.0)
    factors: Iterable[tuple[int, ...]] = (
        chosen for d in range(degree + 1) for chosen in combinations_with_replacement(range(places.shape[1]), d)
    )
    return np.column_stack([np.prod(local[:, list(chosen)], axis=1) for chosen in factors])
