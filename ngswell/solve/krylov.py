"""An iterative method that remembers: solves with one matrix after the other begin from what the earlier ones have found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ngswell.team import ALONE, Team

KEPT = 60
"""Directions that are kept for the next solves."""

NOTHING = 1e-14
"""Size of what round-off leaves of an image that the others make up."""

CANCELLED = 0.5
"""A vector that orthogonalisation leaves less of is orthogonalised again."""


class Krylov:
    """Solves M x = b for an M near the identity: the least residual over the space of all directions tried so far.

    With directions Z, kept over solves, M Z = Q R where QᵀQ = I. The best x = Z y has R y = Qᵀ b and leaves b − Q Qᵀ b,
    which is the next direction. M need not be quite linear: what counts is what it gave. Generalised conjugate residuals.

    Of several ranks each has its own entries of all vectors.
    """

    def __init__(self, size: int, most: int, team: Team = ALONE) -> None:
        self._most, self._team = most, team  # iterations of a solve
        shape = (KEPT + most, size)  # memory is taken as it is filled
        self._directions, self._images = np.empty(shape), np.empty(shape)
        self._triangle = np.zeros((KEPT + most, KEPT + most))
        self._count = 0
        self.iterations = 0  # of the last solve

    def forget(self) -> None:
        """Begin anew, for another matrix."""
        self._count = 0

    def solve(self, product: Callable[[NDArray], NDArray], right: NDArray, tolerance: float, floor: float) -> NDArray | None:
        """x whose residual is below `tolerance` of that of 0, or below `floor`; None if `most` iterations are too few.

        `product` gives M x.
        """
        self._count = min(self._count, KEPT)
        self.iterations = 0
        images = self._images[: self._count]
        parts = self._dot(images, right)
        left = right - parts @ images
        wanted = max(tolerance * self._norm(right), floor)
        amounts = list(parts)
        while not (size := self._norm(left)) <= wanted:
            if self.iterations == self._most or not np.isfinite(size):
                return None
            image = self._add(left / size, product)
            if image is None:
                return None
            amounts.append(float(self._dot(image, left)[0]))
            left = left - amounts[-1] * image
            self.iterations += 1
        count = self._count
        return np.linalg.solve(self._triangle[:count, :count], amounts) @ self._directions[:count] if count else 0 * right

    def _add(self, direction: NDArray, product: Callable[[NDArray], NDArray]) -> NDArray | None:
        """One more direction and its image, orthogonal to the others; None if they tell nothing new."""
        count = self._count
        image, images, parts = product(direction), self._images[:count], np.zeros(count)
        before = 0.0
        size = self._norm(image)
        while size < CANCELLED * before or before == 0.0:
            before = size
            more = self._dot(images, image)
            image = image - more @ images
            parts += more
            size = self._norm(image)
            if not NOTHING < size < np.inf:
                return None
        self._directions[count], self._images[count] = direction, image / size
        self._triangle[:count, count], self._triangle[count, count] = parts, size
        self._count += 1
        return self._images[count]

    def _dot(self, vectors: NDArray, vector: NDArray) -> NDArray:
        """The product with each of `vectors`, or with one."""
        found = np.atleast_1d(vectors @ vector)
        self._team.sum_values(found)
        return found

    def _norm(self, vector: NDArray) -> float:
        return float(np.sqrt(self._dot(vector, vector)[0]))
