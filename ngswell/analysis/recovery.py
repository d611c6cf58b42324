"""Where the mesh is too coarse: each cell's gradients against those that its neighbourhood recovers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np
from ngsolve import CF, VOL, CoefficientFunction, Grad, IntegrationRule, Mesh, specialcf, x, y, z
from numpy.typing import NDArray

from ngswell.mesh.points import points
from ngswell.problem.problem import Problem

FLOOR = 1e-2
"""A gradient below this share of the unknown's natural size over the body's length counts as none."""

NEIGHBOURS = 0.6
"""Weight of the neighbours' gradients against those of the cell itself, in the fit. Segments, quadrilaterals and hexahedra
have points at which gradients are of higher order, and the weight does not matter as the mesh gets finer. Triangles have
none: there the estimate of a smooth field's error tends to 1.2 of the error with 1, to 0.9 with 0.5."""


@dataclass(frozen=True)
class Estimate:
    """Estimated errors of the gradients of all unknowns at one time.

    `errors` are L2 norms over each cell, `sizes` those of the gradient itself over the body, in the same units.
    """

    errors: dict[str, NDArray]
    sizes: dict[str, float]

    @property
    def cells(self) -> NDArray:
        """Share of each cell in the relative error of a gradient, of the unknown where it is largest [-]."""
        return np.max([error / self.sizes[name] for name, error in self.errors.items()], axis=0)

    @property
    def total(self) -> float:
        """Relative error over the body, of the unknown where it is largest [-]."""
        return max(float(np.linalg.norm(error)) / self.sizes[name] for name, error in self.errors.items())


def indicator(problem: Problem) -> NDArray:
    """One number a cell: its share in the relative error of a gradient at the present fields [-]; see `Recovery`."""
    return Recovery(problem).estimate().cells


class Recovery:
    """Recovery-based estimates of the error in space of a problem's fields, after Zienkiewicz and Zhu (1992).

    Around each cell K, for each unknown w of order m, a polynomial g of degree m + 1 is found whose gradient fits that of
    w best (least squares) at the Gauss points of degree 2m − 1 of K and its neighbours. Then

        ‖∇w − ∇w_exact‖_K ≈ ‖∇w − ∇g‖_K

    in L2 of the reference configuration, with the weight 2πr where it is axisymmetric. A gradient averaged onto continuous
    functions of order m would not do: for even m the leading error of a smooth field's gradient is itself continuous, and
    the estimate would vanish. Polynomials of degree m give zero. The hoop strain u_r/r is no gradient and left out.

    Errors are relative to the gradient's norm over the body, or to `FLOOR`, so that uniform fields give zero too.

    Neighbours share a facet and the material: gradients may jump where the named parts of a mesh meet, and are recovered on
    either side. A parameter that jumps inside a part shows as an error of the cells there, and so does any other kink.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        around = _neighbourhoods(problem.mesh)
        order = problem.model.order
        self._patches = {m: _Patches(problem, around, m) for m in (order, order - 1)}

    def estimate(self) -> Estimate:
        """Errors at the present fields of the problem."""
        problem, errors, sizes = self._problem, {}, {}
        for name, field in zip(problem.model.unknowns, problem.fields.components, strict=False):
            patches = self._patches[problem.model.order - (name != "u")]
            errors[name], size = patches.errors(Grad(field))
            floor = FLOOR * problem.references[name] / problem.references["u"]
            sizes[name] = max(size, floor * float(np.sqrt(patches.volume)))
        return Estimate(errors, sizes)


class _Patches:
    """The cells with their neighbours, for unknowns of one order."""

    def __init__(self, problem: Problem, around: list[list[int]], order: int) -> None:
        mesh, self._dim = problem.mesh, problem.mesh.dim
        self._sampled, self._points = points(mesh, VOL, 2 * order - 1), points(mesh, VOL, 2 * order)
        self._weights = _volumes(mesh, self._points, 2 * order) * CF(problem.kinematics.weight)(self._points).ravel()
        self.volume = float(self._weights.sum())
        self._own = _by_cell(mesh, self._points)
        samples = _by_cell(mesh, self._sampled)
        self._around = [np.concatenate([samples[cell] for cell in cells]) for cells in around]
        position = CF((x, y, z)[: self._dim])
        sampled, inside = (position(where).reshape(-1, self._dim) for where in (self._sampled, self._points))
        self._recover = []
        for own, nearby, mine in zip(self._own, self._around, samples, strict=True):
            centre, size = inside[own].mean(axis=0), np.ptp(sampled[nearby], axis=0).max() or 1.0
            weights = np.where(np.isin(nearby, mine), 1.0, NEIGHBOURS).repeat(self._dim)
            fit = _least_squares(_gradients((sampled[nearby] - centre) / size, order + 1) * weights[:, None])
            self._recover.append(_gradients((inside[own] - centre) / size, order + 1) @ (fit * weights))

    def errors(self, gradient: CoefficientFunction) -> tuple[NDArray, float]:
        """Norm over each cell of recovered minus actual gradient, and the norm of the gradient over the body."""
        shape = (-1, gradient.dim // self._dim, self._dim)
        sampled, inside = (gradient(where).reshape(shape).swapaxes(1, 2) for where in (self._sampled, self._points))
        squares = np.empty(len(self._own))
        for cell, (own, nearby, recover) in enumerate(zip(self._own, self._around, self._recover, strict=True)):
            recovered = recover @ sampled[nearby].reshape(-1, shape[1])  # rows by point and direction
            squares[cell] = self._weights[own] @ ((recovered.reshape(inside[own].shape) - inside[own]) ** 2).sum(axis=(1, 2))
        return np.sqrt(squares), float(np.sqrt(self._weights @ (inside**2).sum(axis=(1, 2))))


def _volumes(mesh: Mesh, where: NDArray, order: int) -> NDArray:
    """Volume that each of the integration points of degree `order` stands for."""
    rules = {shape: np.array(IntegrationRule(shape, order).weights) for shape in {cell.type for cell in mesh.Elements(VOL)}}
    weights = np.concatenate([rules[cell.type] for cell in mesh.Elements(VOL)])
    mapping = specialcf.JacobianMatrix(mesh.dim)(where).reshape(-1, mesh.dim, mesh.dim)
    return weights * np.abs(np.linalg.det(mapping))


def _by_cell(mesh: Mesh, where: NDArray) -> list[NDArray]:
    """Rows of `where` that belong to each cell."""
    return np.split(np.argsort(where["nr"], kind="stable"), np.cumsum(np.bincount(where["nr"], minlength=mesh.ne))[:-1])


def _neighbourhoods(mesh: Mesh) -> list[list[int]]:
    """Each cell with those that share a facet and its material, and theirs in turn until they are more than d + 1.

    That many are needed to find all derivatives of order m + 1 of a polynomial, also in corners.
    """
    cells = list(mesh.Elements(VOL))
    at_facet: dict[int, list[int]] = {}
    for cell in cells:
        for facet in cell.facets:
            at_facet.setdefault(facet.nr, []).append(cell.nr)
    next_to: list[set[int]] = [set() for _ in cells]
    for sharing in at_facet.values():
        for cell in sharing:
            next_to[cell] |= {other for other in sharing if cells[other].mat == cells[cell].mat}
    found = []
    for cell in range(mesh.ne):
        near = next_to[cell] | {cell}
        while len(near) <= mesh.dim + 1:
            wider = set.union(*(next_to[other] for other in near)) | near
            if wider == near:
                break
            near = wider
        found.append(sorted(near))
    return found


def _gradients(places: NDArray, degree: int) -> NDArray:
    """Gradients of the monomials up to `degree`, the lower first: rows by point and direction, one column each."""
    dim = places.shape[1]
    exponents = sorted((e for e in product(range(degree + 1), repeat=dim) if 0 < sum(e) <= degree), key=sum)
    powers = places[..., None] ** np.arange(degree + 1)  # point, direction, exponent
    columns = [
        [
            e[i] * prod(powers[:, j, e[j] - (i == j)] for j in range(dim)) if e[i] else np.zeros(len(places))
            for i in range(dim)
        ]
        for e in exponents
    ]
    return np.moveaxis(np.array(columns), (0, 1, 2), (2, 1, 0)).reshape(-1, len(exponents))


def _least_squares(matrix: NDArray) -> NDArray:
    """Pseudo-inverse without the columns that depend on earlier ones.

    Too few neighbours do not tell all monomials of the highest degree apart; those then stay out.
    """
    independent = np.abs(np.diag(np.linalg.qr(matrix, mode="r"))) > 1e-6 * np.linalg.norm(matrix, axis=0)[: len(matrix)]
    columns = np.flatnonzero(independent)
    inverse = np.zeros(matrix.T.shape)
    inverse[columns] = np.linalg.pinv(matrix[:, columns])
    return inverse
