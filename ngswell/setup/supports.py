"""What holds and loads the body: rollers, symmetry planes, pins, tractions, weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from ngswell import checks


@dataclass(frozen=True)
class Roller:
    """The displacement in `direction` ("x", "y"; "xy" for both) vanishes on a boundary.

    Like every boundary it is sealed unless it has a bath."""

    boundary: str
    direction: str

    def __post_init__(self) -> None:
        checks.name("Roller: boundary", self.boundary, "left|right")
        checks.name("Roller: direction", self.direction, "x")


@dataclass(frozen=True)
class Symmetry:
    """A symmetry plane: the displacement normal to a straight boundary along an axis vanishes; no flow through it."""

    boundary: str

    def __post_init__(self) -> None:
        checks.name("Symmetry: boundary", self.boundary, "left")


@dataclass(frozen=True)
class Pin:
    """The displacement in `direction` vanishes at the mesh vertex at `point` [mm]."""

    point: tuple[float, ...]
    direction: str

    def __post_init__(self) -> None:
        checks.settle(self, point=checks.vector("Pin: point", self.point, 1e6, "mm"))
        checks.name("Pin: direction", self.direction, "x")


Support: TypeAlias = Roller | Symmetry | Pin


@dataclass(frozen=True)
class Traction:
    """Traction on a boundary [N/mm²], per area and in the direction of the reference configuration, eq. (36)."""

    boundary: str
    vector: tuple[float, ...]

    def __post_init__(self) -> None:
        checks.name("Traction: boundary", self.boundary, "top")
        checks.settle(self, vector=checks.vector("Traction", self.vector, 1e3, "N/mm²"))


@dataclass(frozen=True)
class Weight:
    """Body force ρ b of (16) from the specific weights of solid and fluid substance [N/mm³]; water has 1e-5.

    The fluid's weight also drives seepage, as in (19). `fluid` and `solid` are vectors, such as (0, -1e-5).
    """

    fluid: tuple[float, ...]
    solid: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("fluid", "solid"):
            checks.settle(self, **{name: checks.vector(f"Weight: {name}", getattr(self, name), 1.0, "N/mm³")})


Load: TypeAlias = Traction | Weight
