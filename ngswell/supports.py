"""What holds and loads the body: rollers, symmetry planes, pins, tractions, weight."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TypeAlias

from ngswell.errors import InputError


@dataclass(frozen=True)
class Roller:
    """The displacement in `direction` ("x", "y"; "xy" for both) vanishes on a boundary.

    Like every boundary it is sealed unless it has a bath."""

    boundary: str
    direction: str


@dataclass(frozen=True)
class Symmetry:
    """A symmetry plane: the displacement normal to a straight boundary along an axis vanishes; no flow through it."""

    boundary: str


@dataclass(frozen=True)
class Pin:
    """The displacement in `direction` vanishes at the mesh vertex at `point` [mm]."""

    point: tuple[float, ...]
    direction: str


Support: TypeAlias = Roller | Symmetry | Pin


@dataclass(frozen=True)
class Traction:
    """Traction on a boundary [N/mm²], per area and in the direction of the reference configuration, eq. (36)."""

    boundary: str
    vector: tuple[float, ...]

    def __post_init__(self) -> None:
        _finite("Traction", self.vector, 1e3, "N/mm²")


@dataclass(frozen=True)
class Weight:
    """Body force ρ b of (16) from the specific weights of solid and fluid substance [N/mm³]; water has 1e-5.

    The fluid's weight also drives seepage, as in (19). `fluid` and `solid` are vectors, such as (0, -1e-5).
    """

    fluid: tuple[float, ...]
    solid: tuple[float, ...]

    def __post_init__(self) -> None:
        _finite("Weight", self.fluid + self.solid, 1.0, "N/mm³")


Load: TypeAlias = Traction | Weight


def _finite(name: str, values: tuple[float, ...], limit: float, unit: str) -> None:
    for value in values:
        if not (isfinite(value) and abs(value) <= limit):
            raise InputError(f"{name} has a component {value!r} {unit}: it has to be finite and within ±{limit:g}")
