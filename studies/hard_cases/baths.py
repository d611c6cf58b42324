"""Baths over their whole range, and penalties over theirs."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from ngswell import TABLE_1, TABLE_2, Adaptive, Concentration, Penalty, Ramp, column
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.closed_forms.linear_column import conductance, diffusivities, penalty_efflux, potentials, storage
from ngswell.models.model import Model
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, CELLS, at_rest, block_scene, column_scene, distance
from studies.hard_cases.linear import COUNT, followed, linear_column, rested
from studies.scenes import BATH, COLUMN_HEIGHT, P0

# -- bath_range ----------------------------------------------------------------------------------------------------------


def bath_range(quick: bool) -> list[Attempt]:
    """Baths from 1e-9 to 5 mol/l, changed at once or within seconds, from rest: J at the end by its closed form.

    The end is homogeneous, so every mesh holds it. What is left is Newton's tolerance, 1e-8, and what the last steps, long
    ones of backward Euler, leave of the slowest mode: 2e-8 at most was measured on the block, whose mode is the slower.
    """
    column_changes = [
        (BATH, 1e-9, 0.0),
        (5.0, 1e-9, 0.0),
        (5.0, 1e-9, 10.0),
        (BATH, 5.0, 0.0),
        (BATH, 5.0, 1.0),
        (1e-9, 5.0, 0.0),
    ]
    block_changes = [(1.0, 1e-9, 0.0)]
    if not quick:
        column_changes += [(BATH, 1e-6, 0.0), (BATH, 1e-3, 0.0), (BATH, 1.0, 0.0)]
        column_changes += [(BATH, 5.0, 100.0), (1e-4, 5.0, 0.0), (1e-4, 5.0, 100.0), (1e-9, 5.0, 100.0)]
        block_changes += [(1.0, 1e-9, 10.0), (1.0, 5.0, 0.0), (5.0, 1e-9, 0.0), (1e-9, 5.0, 0.0)]
    scenes = [
        ("column", partial(column_scene, cells=10), "confined", TABLE_1, P0, 3e6, column_changes),
        ("block", partial(block_scene, cells=4), "plane strain", TABLE_2, 0.0, 1e7, block_changes),
    ]
    found = []
    for body, scene_of, motion, material, load, until, changes in scenes:
        for before, after, within in changes:
            bath = Ramp((0.0, before), (within, after)) if within else after
            J = homogeneous_equilibrium(material, after, motion, load=load).J
            for name, (model, treatment) in CHOICES.items():
                found.append(
                    attempt(
                        f"{body}, {before:g} → {after:g} mol/l " + (f"in {within:g} s" if within else "at once"),
                        name,
                        partial(scene_of, model, treatment, bath),
                        until,
                        "J",
                        partial(distance, {"J": lambda *at, J=J: J}, 4),
                        1e-8 if body == "column" else 1e-7,
                        Adaptive(1e-2),
                        start=partial(at_rest, before, motion, load),
                        newton=ACCURATE,
                    )
                )
    return found


# -- penalties -----------------------------------------------------------------------------------------------------------


def penalised_efflux(model: Model, relative: float) -> NDArray:
    """Effluxes per excess of (P, Σ) of the linear column, cells of h = 1/40 mm.

    `Potential` takes ε_p for P − P̄ with P = P_linear + c̄ Σ, and ε_c for c̃ − c̄ = c̄ Σ/(2 Rθ).
    """
    cell = COLUMN_HEIGHT / CELLS
    if isinstance(model, Concentration):
        return penalty_efflux(TABLE_1, BATH, relative, cell)
    K, D = TABLE_1.number("K"), TABLE_1.number("D_plus")
    return relative / cell * np.array([[K, K * BATH], [0.0, D * BATH / (2 * TABLE_1.RT)]])


def penalties(quick: bool) -> list[Attempt]:
    """Penalties from 1e-6 to 1e9 in units of K/h and D₊/h.

    A penalty is a resistance in series: the top's displacement after a small change of the bath against the linear column
    with effluxes ε times the excess, in the same time steps; for ε → 0 the column, uniform, relaxes like exp(−C⁻¹G t/h)
    (`relaxed`). Steps cover the relaxation, h²/κ + h max eig(G⁻¹ C). Large ones are those of the exact treatments, to the
    order of 1/ε (`test_hard_ions`). The mesh's share, 20 cells, is 7e-4. At rest the penalty does not enter.
    """
    L = conductance(TABLE_1, BATH)
    C = storage(TABLE_1, BATH)
    found = []
    for relative in 10.0 ** np.arange(-6, 10, 3 if quick else 1):
        for name in DEFAULTS:
            G = penalised_efflux(CHOICES[name][0], relative)
            slow = COLUMN_HEIGHT**2 / diffusivities(C, L)[0][0] / COUNT
            slow += 4 * COLUMN_HEIGHT * float(np.abs(np.linalg.eigvals(np.linalg.solve(G, C))).max()) / COUNT
            treatment, title = Penalty(relative=float(relative)), f"ε = {relative:g} K/h and D₊/h"
            reference = linear_column([(COLUMN_HEIGHT, L)], slow, COUNT, G)
            on = column(COLUMN_HEIGHT, CELLS)
            found.append(followed(title, name, reference, slow, 2e-3, on, treatment=treatment))
            found.append(rested(f"{title}, at rest", name, 1e4 * slow, TABLE_1, treatment))
    return found


def relaxed(model: Model, relative: float, step: float) -> NDArray:
    """`linear_column` for a vanishing penalty: C dw/dt = −G (w − w_D)/h, w uniform."""
    C, G, target = storage(TABLE_1, BATH), penalised_efflux(model, relative), potentials(TABLE_1, BATH, salt=1.0)
    w, found = np.zeros(2), []
    for _ in range(COUNT):
        w = np.linalg.solve(C * COLUMN_HEIGHT / step + G, C @ w * COLUMN_HEIGHT / step + G @ target)
        found.append(float(COLUMN_HEIGHT * C[0] @ w))
    return np.array(found)
