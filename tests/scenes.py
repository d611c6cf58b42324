"""Scenes that several tests use."""

from __future__ import annotations

import numpy as np
from ngsolve import IfPos, x, y

from ngswell import (
    TABLE_1,
    TABLE_2,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    Material,
    Penalty,
    PlaneStrain,
    Ramp,
    Roller,
    Scene,
    Spatial,
    Symmetry,
    Traction,
    Weight,
    box,
    column,
    rectangle,
)
from ngswell.physics import donnan

WEAK = Penalty(1.0)
P0 = donnan.pressure(0.15, 0.2, TABLE_1.RT)
"""Overall pressure of Table 1 in 0.15 mol/l [N/mm²]: the load under which the reference state is at rest."""
FALLING = Ramp((0, 0.15), (10, 0.125))  # s, mol/l

NUMBERS = {"mu": 0.24, "lam": 0.02, "nS0": 0.25, "cfc0": 0.2, "D_plus": 5e-4, "D_minus": 8e-4, "K": 1e-3}
"""What a material needs."""
UNCHARGED = Material(**{**NUMBERS, "cfc0": 0.0})
"""Salt beside a solid without charge."""
WITHOUT_IONS = Material(mu=0.24, lam=0.02, nS0=0.25, K=1e-3)


def strip(treatment=WEAK, c=0.15, cells=(1, 30), **changes) -> Scene:
    """The strip of Fig. 8."""
    return Scene(
        **{
            "mesh": rectangle(0.02, 0.5, *cells),
            "kinematics": PlaneStrain(),
            "material": TABLE_1,
            "model": Concentration(),
            "supports": [Roller("bottom", "y"), Roller("left|right", "x")],
            "baths": [Bath("top", c=c, treatment=treatment)],
            "loads": [Traction("top", (0.0, -P0))],
            **changes,
        }
    )


def confined_column(treatment=WEAK, c=0.15, cells=30, **changes) -> Scene:
    """The same as a 1-d column."""
    return Scene(
        **{
            "mesh": column(0.5, cells),
            "kinematics": Confined(),
            "material": TABLE_1,
            "model": Concentration(),
            "supports": [Roller("bottom", "x")],
            "baths": [Bath("top", c=c, treatment=treatment)],
            "loads": [Traction("top", (-P0,))],
            **changes,
        }
    )


def quarter(treatment=None, c=0.15, cells=4, **changes) -> Scene:
    """A quarter of a square, 1 mm wide, with the bath on its free sides."""
    return Scene(
        **{
            "mesh": rectangle(1.0, 1.0, cells, cells),
            "kinematics": PlaneStrain(),
            "material": TABLE_2,
            "supports": [Symmetry("left"), Symmetry("bottom")],
            "baths": [Bath("top|right", c=c, treatment=treatment)],
            **changes,
        }
    )


def block(**changes) -> Scene:
    """A small block with everything a scene can have, out of equilibrium."""
    layered = Material(
        mu=0.12 + 0.05 * y, lam=0.02, nS0=IfPos(x - 0.5, 0.25, 0.2), cfc0=0.4 + 0.3 * x, D_plus=5e-4, D_minus=8e-4, K=1.07e-3
    )
    return Scene(
        **{
            "mesh": rectangle(1.0, 1.0, 2, 2),
            "kinematics": PlaneStrain(),
            "material": layered,
            "model": Concentration(),
            "supports": [Roller("bottom", "y"), Roller("left", "x")],
            "baths": [Bath("top", c=0.5, P=0.01, treatment=Penalty(3.0)), Bath("right", c=0.5, P=0.01)],
            "loads": [Traction("top", (0.01, -0.02)), Weight((0.0, -1e-2), (0.0, -2e-2))],
            **changes,
        }
    )


BETWEEN_WALLS = {
    "confined": (lambda: column(1.0, 2), Confined(), [], "x", 1.0),
    "plane strain": (lambda: rectangle(1, 1, 2, 2), PlaneStrain(), [Roller("left|right", "x")], "y", 1.0),
    "axisymmetric": (lambda: rectangle(1, 1, 2, 2), Axisymmetric(), [Roller("left|right", "r")], "z", np.pi),
    "3-d": (
        lambda: box(1, 1, 1, 1, 1, 1), Spatial(), [Roller("left|right", "x"), Roller("front|back", "y")], "z", 1.0,
    ),
}  # fmt: skip
"""Bodies of height 1 that stretch along one direction: mesh, motion, walls, that direction, area of the base."""

FREE = {
    "confined": (lambda: column(1.0, 2), Confined(), [Roller("bottom", "x")], "top"),
    "plane strain": (lambda: rectangle(1, 1, 2, 2), PlaneStrain(), [Symmetry("left"), Symmetry("bottom")], "top|right"),
    "axisymmetric": (
        lambda: rectangle(1, 1, 2, 2), Axisymmetric(), [Roller("left", "r"), Roller("bottom", "z")], "top|right",
    ),
    "3-d": (
        lambda: box(1, 1, 1, 1, 1, 1), Spatial(), [Symmetry("left"), Symmetry("front"), Symmetry("bottom")],
        "right|back|top",
    ),
}  # fmt: skip
"""Bodies that stretch alike in all directions that the motion leaves free: mesh, motion, supports, free sides."""

CLOSED = {"confined": "confined", "plane strain": "plane strain", "axisymmetric": "3-d", "3-d": "3-d"}
"""Their closed forms: the motion that `homogeneous_equilibrium` takes."""

SIZES = {
    "u": 0.02,
    "p": 0.05,
    "c": 0.1,
    "cfc": 0.05,
    "P": 0.05,
    "salt": 0.1,
    "efflux of fluid": 0.05,
    "efflux of cations": 0.05,
}


def deformed(problem, seed=1):
    """A state near the initial one in which every term acts."""
    problem.initialise()
    rng = np.random.default_rng(seed)
    for name, part in problem.ranges.items():
        problem.vector[part] += SIZES[name] * rng.standard_normal(part.stop - part.start)
    held = slice(0, problem.ranges["u"].stop)
    problem.vector[held] *= np.array(problem.free)[held]  # a cylinder's axis stays one: u_r/r would be infinite
