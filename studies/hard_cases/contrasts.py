"""Permeability and diffusivities that jump, or differ by decades."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from ngsolve import IfPos, Mesh, x
from numpy.typing import NDArray

from ngswell import TABLE_1, Material, column
from ngswell.closed_forms.linear_column import conductance, diffusivities, storage
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt
from studies.hard_cases.bodies import CELLS
from studies.hard_cases.linear import COUNT, followed, linear_column, rested
from studies.scenes import BATH, COLUMN_HEIGHT

TIGHT = 1e-4
"""Permeability and diffusivities of a layer over those of the other."""

SCALED = {"K": ("K",), "D": ("D_plus", "D_minus"), "K and D": ("K", "D_plus", "D_minus")}


def layered(of: str, tight_at: str) -> tuple[Material, list[tuple[float, NDArray]]]:
    """Table 1 with half of the column tight, and the halves (thickness, conductance) from the bottom up."""
    scaled: dict[str, Any] = {name: TIGHT * TABLE_1.number(name) for name in SCALED[of]}
    tight = replace(TABLE_1, **scaled)
    lower, upper = (TABLE_1, tight) if tight_at == "bath" else (tight, TABLE_1)
    fields: dict[str, Any] = {
        name: IfPos(x - COLUMN_HEIGHT / 2, upper.number(name), lower.number(name)) for name in SCALED[of]
    }
    return replace(TABLE_1, **fields), [(COLUMN_HEIGHT / 2, conductance(m, BATH)) for m in (lower, upper)]


def both_ends(cells: int) -> Mesh:
    """Cells thinned a thousand times towards both ends, with a node in the middle."""
    return column(COLUMN_HEIGHT, cells, grade={"bottom": 1e3, "top": 1e3})


def contrasts(quick: bool) -> list[Attempt]:
    """Permeability and diffusivities that jump by 1e4 in the middle, or differ by decades everywhere.

    The displacement of the top after a small change of the bath, in the same time steps as `linear_column`: what is left is
    the mesh, second order in the cell. With 40 even cells it is below 3e-3 wherever the layer at the bath passes sqrt(κ Δt)
    of a cell or more. A tight skin, which steps of 5 s enter by 0.5 µm, needs cells thinner than that at the bath (`skin`);
    thinned a thousand times, 40 leave 3.4e-3. Homogeneous columns over twenty twentieths of h²/κ on 20 cells. And rest after
    a large change, which no coefficient enters: DampedNewton's tolerance, and what the last steps leave of the slowest mode.
    """
    found = []
    for name in DEFAULTS if quick else ("Potential", "Concentration", "Concentration, Multiplier"):
        for of in ("K and D",) if quick else SCALED:
            for tight_at in ("bath", "bottom"):
                material, layers = layered(of, tight_at)
                for step in (5.0, 5e4):
                    on = both_ends(40) if tight_at == "bath" and step == 5.0 else column(COLUMN_HEIGHT, 40)
                    reference = linear_column(layers, step, COUNT)
                    title = f"{of} × 1e-4 at the {tight_at}, steps of {step:g} s"
                    found.append(followed(title, name, reference, step, 5e-3, on, material))
        uniform: dict[str, dict[str, Any]] = {}
        uniform |= {f"D₋/D₊ = {ratio:g}": {"D_minus": ratio * TABLE_1.number("D_plus")} for ratio in (100.0, 0.01)}
        uniform |= {f"K = {K:.3g} mm⁴/(N s)": {"K": K} for K in 1.07 * 10.0 ** np.arange(-6.0, 1.0, 3 if quick else 1)}
        for title, changed in uniform.items():
            L = conductance(replace(TABLE_1, **changed), BATH)
            step = COLUMN_HEIGHT**2 / diffusivities(storage(TABLE_1, BATH), L)[0][0] / COUNT
            reference = linear_column([(COLUMN_HEIGHT, L)], step, COUNT)
            found.append(
                followed(title, name, reference, step, 2e-3, column(COLUMN_HEIGHT, CELLS), replace(TABLE_1, **changed))
            )
    for name in DEFAULTS if quick else CHOICES:
        for tight_at in ("bath", "bottom"):
            material, _ = layered("K and D", tight_at)
            found.append(rested(f"K and D × 1e-4 at the {tight_at}, at rest", name, 1e9, material))
    return found


def skin(quick: bool = False) -> dict[str, NDArray]:
    """For a figure: error of the top's displacement over the cells, a tight skin at the bath in steps of 5 s."""
    material, layers = layered("K and D", "bath")
    reference = linear_column(layers, 5.0, COUNT)
    counts = np.array([10, 20, 40] if quick else [10, 20, 40, 80, 160])
    meshes: dict[str, Callable[[int], Mesh]] = {"even": partial(column, COLUMN_HEIGHT), "graded": both_ends}
    found = {
        kind: np.array([followed("", "Potential", reference, 5.0, np.inf, mesh(int(n)), material).error for n in counts])
        for kind, mesh in meshes.items()
    }
    return {"cells": counts, **found}
