"""Scenes that ranks compute together, by name, each with its steps and end: every motion, model and treatment."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Axisymmetric,
    Bath,
    Concentration,
    Essential,
    Fixed,
    LocalDonnan,
    Multiplier,
    Nitsche,
    Obstacle,
    Penalty,
    Platen,
    Potential,
    Pressure,
    Ramp,
    RigidPlane,
    Scene,
    Spatial,
    Symmetry,
    Traction,
    Uncharged,
    Vessel,
    box,
    rectangle,
)
from tests.scenes import FALLING, P0, WITHOUT_IONS, block, quarter, strip

FIXED, ADAPTIVE = Fixed(5.0), Adaptive(1e-2)
PRESSED = [Pressure("top|right", P0)]
"""What holds the charged body at rest in the bath of the start."""
MILD: dict[str, Any] = {"material": TABLE_1, "loads": PRESSED}
PUSHED = Ramp((0, 0.0), (10, -0.02))


def cube(cells: int = 3, **changes: Any) -> Scene:
    """An eighth of a cube with the bath on its free sides."""
    return Scene(
        **{
            "mesh": box(1.0, 1.0, 1.0, cells, cells, cells),
            "kinematics": Spatial(),
            "material": TABLE_1,
            "supports": [Symmetry("left"), Symmetry("front"), Symmetry("bottom")],
            "baths": [Bath("top|right|back", c=FALLING)],
            "loads": [
                Traction("top", (0.0, 0.0, -P0)),
                Traction("right", (-P0, 0.0, 0.0)),
                Traction("back", (0.0, -P0, 0.0)),
            ],
            **changes,
        }
    )


def cylinder(**changes: Any) -> Scene:
    """A quarter of a disc's section between platens, in a falling bath."""
    return Scene(
        **{
            "mesh": rectangle(1.0, 0.5, 6, 4),
            "kinematics": Axisymmetric(),
            "material": TABLE_2,
            "supports": [Symmetry("left"), Symmetry("bottom"), Platen("top", force=PUSHED)],
            "baths": [Bath("right", c=FALLING)],
            **changes,
        }
    )


def touched(**changes: Any) -> Scene:
    """A strip that swells against a plane."""
    wall = Obstacle("top", RigidPlane((0.0, 0.5002), (0.0, -1.0)))
    return strip(None, FALLING, (2, 8), model=Potential(), loads=[Traction("top", (0.0, -P0)), wall], **changes)


def uncharged(**changes: Any) -> Scene:
    """A strip without ions under a sudden pressure of its bath."""
    return strip(
        model=Uncharged(),
        material=WITHOUT_IONS,
        cells=(2, 8),
        loads=[],
        baths=[Bath("top", P=Ramp((0, 0.0), (1, 0.01)))],
        **changes,
    )


SCENES: dict[str, tuple[Callable[..., Scene], Any, float]] = {
    "plane, potential": (partial(quarter, None, FALLING, 6), ADAPTIVE, 40.0),
    "strip, penalty": (partial(strip, Penalty(1.0), FALLING, (1, 12)), FIXED, 20.0),
    "strip, Nitsche": (partial(strip, Nitsche(), FALLING, (1, 12)), FIXED, 20.0),
    "strip, prescribed": (partial(strip, Essential(), FALLING, (1, 12), model=Potential()), FIXED, 20.0),
    "plane, multipliers": (
        partial(quarter, Multiplier(), FALLING, 5, **{**MILD, "model": Concentration()}),
        FIXED,
        20.0,
    ),
    "plane, everything": (block, FIXED, 10.0),
    "cylinder, platen": (cylinder, ADAPTIVE, 30.0),
    "plane, local equilibrium": (partial(quarter, None, FALLING, 4, model=LocalDonnan()), FIXED, 20.0),
    "plane, vessel": (
        partial(quarter, cells=4, baths=[Bath("top|right", c=0.1, vessel=Vessel(2.0))], initial=(0.15, 0.0)),
        ADAPTIVE,
        40.0,
    ),
    "strip, obstacle": (touched, ADAPTIVE, 40.0),
    "strip, uncharged": (uncharged, FIXED, 10.0),
    "cube, potential": (cube, ADAPTIVE, 20.0),
    "cube, concentration, order 3": (partial(cube, 2, model=Concentration(3)), FIXED, 10.0),
    "cube, prescribed": (partial(cube, 2, baths=[Bath("top|right|back", c=FALLING, treatment=Essential())]), FIXED, 10.0),
}
