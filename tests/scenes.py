"""Scenes that several tests use."""

from __future__ import annotations

from ngswell import TABLE_1, Bath, Concentration, Confined, Penalty, PlaneStrain, Roller, Scene, Traction, column, rectangle
from ngswell.physics import donnan

WEAK = Penalty(1.0)
P0 = donnan.pressure(0.15, 0.2, TABLE_1.RT)
"""Overall pressure of Table 1 in 0.15 mol/l [N/mm²]: the load under which the reference state is at rest."""


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
