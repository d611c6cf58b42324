"""Scenes and states that several studies share: each is built here, and only here."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from ngsolve import CoefficientFunction, IfPos, x, y

from ngswell import (
    TABLE_1,
    TABLE_2,
    Bath,
    Blend,
    Concentration,
    Confined,
    Material,
    Penalty,
    Pin,
    PlaneStrain,
    Ramp,
    Roller,
    Scene,
    Symmetry,
    Traction,
    column,
    rectangle,
)
from ngswell.baths.treatment import Treatment
from ngswell.models.model import Model
from ngswell.physics import donnan
from ngswell.problem.discretisation import Discretisation
from ngswell.setup.snapshot import Snapshot

WEAK = Penalty(1.0)
"""The paper's penalty for Table 1."""

# -- Table 1: the column of Fig. 4 and the strip of Fig. 8 -------------------------------------------------------------

BATH = 0.15
"""The bath in which Table 1 starts [mol/l]."""

COLUMN_HEIGHT = 0.5
"""Height of column and strip [mm]."""

FALLING = Ramp((0, BATH), (10, 0.125))
"""The bath of Fig. 4 [s, mol/l]."""


def rest_load(material: Material, bath: float = BATH) -> float:
    """Overall pressure in the bath [N/mm²]: the load under which the charged, stress-free reference state is at rest."""
    return donnan.pressure(bath, material.cfc0, material.RT)


P0 = rest_load(TABLE_1)
"""`rest_load` of Table 1 in 0.15 mol/l [N/mm²]."""


def confined_column(treatment: Treatment | None = WEAK, c: Any = BATH, cells: int = 60, **changes: Any) -> Scene:
    """The 1-d column of Table 1, held at the bottom, bath `c` and equilibrium load on top; `changes` replace any part."""
    return Scene(
        **{
            "mesh": column(COLUMN_HEIGHT, cells),
            "kinematics": Confined(),
            "material": TABLE_1,
            "model": Concentration(),
            "supports": [Roller("bottom", "x")],
            "baths": [Bath("top", c=c, treatment=treatment)],
            "loads": [Traction("top", (-P0,))],
            **changes,
        }
    )


def strip(
    treatment: Treatment | None = WEAK, c: Any = BATH, cells: tuple[int, int] = (1, 30), width: float = 0.02, **changes: Any
) -> Scene:
    """The strip of Table 1 between frictionless walls, bath `c` and equilibrium load on top; `changes` replace any part."""
    return confined_column(
        treatment,
        c,
        **{
            "mesh": rectangle(width, COLUMN_HEIGHT, *cells),
            "kinematics": PlaneStrain(),
            "supports": [Roller("bottom", "y"), Roller("left|right", "x")],
            "loads": [Traction("top", (0.0, -P0))],
            **changes,
        },
    )


# -- the free-swelling block of Figs. 9 and 10 -------------------------------------------------------------------------

WIDTH, HEIGHT = 1.1, 1.0  # mm, half of the block
INITIAL, END = 7000.0, 11000.0  # s: at rest after the ramp of the charge; end of the dilution
SIDE = Ramp((7000, 4.1), (7080, 2.7), (7220, 0.3))  # s, mol/l: top and left
BOTTOM = Ramp((7000, 4.1), (7080, 2.7), (8000, 2.7), (10000, 0.3))
BLENDED = 0.3
"""Distance from the bottom corner over which the baths blend [mm]."""


def blended_baths(
    treatment: Treatment | None,
    bottom: Any = BOTTOM,
    width: float = BLENDED,
    side: str = "left",
    from_side: CoefficientFunction = x,
) -> list[Bath]:
    """`SIDE` on top and on one side, `bottom` below; around the corner between them they blend over `width` [mm].

    `from_side` is the distance from the side [mm].
    """

    def fading(distance: CoefficientFunction) -> CoefficientFunction:
        return 0.5 * IfPos(width - distance, (width - distance) / width, 0.0)

    return [
        Bath("top", c=SIDE, treatment=treatment),
        Bath(side, c=Blend(SIDE, bottom, fading(y)), treatment=treatment),
        Bath("bottom", c=Blend(bottom, SIDE, fading(from_side)), treatment=treatment),
    ]


def free_swelling_block(nx: int, ny: int, **changes: Any) -> Scene:
    """Half of the block of Table 2 on nx × ny quadrilaterals, as in the paper; `changes` replace any part."""
    return Scene(
        **{
            "mesh": rectangle(WIDTH, HEIGHT, nx, ny),
            "kinematics": PlaneStrain(),
            "material": TABLE_2,
            "model": Concentration(),
            "charge": Ramp((0, 0.0), (4000, 1.0)),
            "supports": [Symmetry("right"), Pin((0.0, 0.0), "y")],
            "baths": blended_baths(Penalty(40.0)),
            **changes,
        }
    )


def quarter_block(treatment: Treatment | None, c: Any, cells: int, **parts: Any) -> Scene:
    """A quarter of a square of 2 mm that swells freely: symmetric to its left and bottom, the bath on top and right."""
    return Scene(
        **{
            "mesh": rectangle(1.0, 1.0, cells, cells),
            "kinematics": PlaneStrain(),
            "supports": [Symmetry("left"), Symmetry("bottom")],
            "baths": [Bath("top|right", c=c, treatment=treatment)],
            **parts,
        }
    )


# -- variations and states ---------------------------------------------------------------------------------------------


def with_treatment(scene: Scene, treatment: Treatment | None) -> Scene:
    """The scene with all its baths imposed by `treatment`, or as its model does by default."""
    return replace(scene, baths=[replace(bath, treatment=treatment) for bath in scene.baths])


def with_model(scene: Scene, model: Model, treatment: Treatment | None = None) -> Scene:
    """The scene with another model, its baths imposed by `treatment` or as that model does by default."""
    return with_treatment(replace(scene, model=model), treatment)


def with_noise(problem: Discretisation, state: Snapshot, size: float) -> Snapshot:
    """The state with a random displacement of `size` [mm] on what is free; always the same one."""
    u = problem.ranges["u"]
    noise = np.zeros_like(state.values)
    noise[u] = size * np.random.default_rng(8).standard_normal(u.stop - u.start)
    noise[~np.array(list(problem.free))] = 0.0
    return Snapshot(state.time, state.values + noise)


def disturbed(scene: Scene, share: float = 1e-16) -> Snapshot:
    """The initial state with noise of `share` of the scene's length, by default of round-off size."""
    problem = scene.problem
    problem.initialise()
    return with_noise(problem, problem.snapshot(scene.start), share * problem.references["u"])
