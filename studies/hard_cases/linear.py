"""The linear column in layers, spectrally in space and in the same time steps, and attempts that are compared with it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from ngsolve import Mesh
from numpy.typing import NDArray

from ngswell import TABLE_1, Adaptive, Fixed, Material, Probe, Result, Scene
from ngswell.baths.treatment import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.closed_forms.linear_column import diffusivities, potentials, storage
from studies.hard_cases.attempt import CHOICES, Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, column_scene, distance
from studies.scenes import BATH, COLUMN_HEIGHT, P0


def legendre(degree: int) -> tuple[NDArray, NDArray]:
    """Weights and differentiation matrix of Gauss–Lobatto–Legendre interpolation on [−1, 1]."""
    series = np.polynomial.legendre.Legendre.basis(degree)
    nodes = np.concatenate([[-1.0], np.sort(series.deriv().roots().real), [1.0]])
    values = series(nodes)
    weights = 2 / (degree * (degree + 1) * values**2)
    gaps = nodes[:, None] - nodes + np.eye(degree + 1)
    slopes = values[:, None] / values / gaps
    np.fill_diagonal(slopes, 0.0)
    slopes[0, 0], slopes[-1, -1] = -degree * (degree + 1) / 4, degree * (degree + 1) / 4
    return weights, slopes


def linear_column(
    layers: Sequence[tuple[float, NDArray]], step: float, count: int, efflux: NDArray | None = None
) -> NDArray:
    """Displacement of the top [mm] after 1, 2, … `count` steps of backward Euler, per small change of the bath [mol/l].

    C ∂w/∂t = ∂(L ∂w)/∂x of `closed_forms.linear_column` on layers (thickness [mm], L), from the sealed bottom up; at the
    top w is the bath's, or −L ∂w = efflux (w − the bath's). Spectral elements of degree 12, each layer in pieces thinned by
    four towards its ends down to sqrt(κ Δt): 1e-8 against the closed form of `LinearColumn`.
    """
    C, jump = storage(TABLE_1, BATH), potentials(TABLE_1, BATH, salt=1.0)
    pieces = []
    for h, L in layers:
        reach = np.sqrt(diffusivities(C, L)[0][0] * step)
        levels = max(0, int(np.ceil(np.log(h / reach) / np.log(4))))
        thin = 0.5 * 4.0 ** np.arange(1 - levels, 1)
        shares = np.unique(np.concatenate([[0.0, 1.0], thin, 1 - thin]))
        pieces += [(h * part, L) for part in np.diff(shares)]
    weights, slopes = legendre(12)
    size = 12 * len(pieces) + 1
    storages, flows = np.zeros((size, 2, size, 2)), np.zeros((size, 2, size, 2))
    strain = np.zeros((size, 2))
    for number, (h, L) in enumerate(pieces):
        mine = slice(12 * number, 12 * number + 13)
        storages[mine, :, mine] += np.einsum("ij,kl->ikjl", np.diag(weights * h / 2), C)
        flows[mine, :, mine] += np.einsum("ij,kl->ikjl", slopes.T @ np.diag(weights) @ slopes * 2 / h, L)
        strain[mine] += np.outer(weights * h / 2, C[0])
    mass, stiff = storages.reshape(2 * size, -1) / step, flows.reshape(2 * size, -1)
    top = slice(2 * size - 2, 2 * size)
    forcing = np.zeros(2 * size)
    system = mass + stiff
    if efflux is None:
        system[top], mass[top], forcing[top] = np.eye(2 * size)[top], 0.0, jump
    else:
        system[top, top] += efflux
        forcing[top] = efflux @ jump
    w, found = np.zeros(2 * size), []
    inverse = np.linalg.inv(system)
    for _ in range(count):
        w = inverse @ (mass @ w + forcing)
        found.append(float(strain.ravel() @ w))
    return np.array(found)


SMALL = -1e-6
"""A change of the bath [mol/l] whose square, 1e-6 to 1e-5 of the response, is far below the errors of the meshes."""

COUNT = 20
"""Steps of one size in which linear columns are followed."""


def followed(
    title: str,
    name: str,
    reference: NDArray,
    step: float,
    bound: float,
    mesh: Mesh,
    material: Material = TABLE_1,
    treatment: Treatment | None = None,
) -> Attempt:
    """The top's displacement after a small change of the bath, over steps of one size, against its linear `reference`."""
    model, usual = CHOICES[name]
    top = Probe((COLUMN_HEIGHT,), "displacement")

    def error(scene: Scene, result: Result) -> float:
        found = top.values["displacement"].ravel()[1:] / SMALL
        return float(np.abs(found - reference).max() / np.abs(reference).max())

    make = partial(column_scene, model, treatment or usual, BATH + SMALL, 1, material, mesh=mesh)
    measure = "displacement"
    return attempt(title, name, make, step * COUNT, measure, error, bound, Fixed(step), [top], newton=ACCURATE)


def rested(title: str, name: str, until: float, material: Material, treatment: Treatment | None = None) -> Attempt:
    """J at rest in 0.0125 mol/l, changed at once: it depends on neither permeability, diffusivities nor penalty."""
    model, usual = CHOICES[name]
    J = homogeneous_equilibrium(TABLE_1, 0.0125, "confined", load=P0).J
    make = partial(column_scene, model, treatment or usual, 0.0125, 10, material)
    error = partial(distance, {"J": lambda *at: J}, 4)
    return attempt(title, name, make, until, "J at rest", error, 1e-6, Adaptive(1e-2), newton=ACCURATE)
