"""No charge, no ions: finite-strain consolidation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from ngsolve import CoefficientFunction

from ngswell.errors import InputError
from ngswell.models.model import BathData, FieldContext
from ngswell.models.one_pressure import OnePressure
from ngswell.models.solid_state import SolidState
from ngswell.physics import laws
from ngswell.physics.material import Material


@dataclass(frozen=True)
class State(SolidState):
    """Displacement and pore pressure p."""

    p: CoefficientFunction

    @property
    def pressure(self) -> CoefficientFunction:
        """What a bath prescribes [N/mm²]."""
        return self.p

    @property
    def pore_pressure(self) -> CoefficientFunction:
        """p [N/mm²]."""
        return self.p

    def seepage(self, frame: CoefficientFunction) -> CoefficientFunction:
        """Darcy's law nF wF = −K grad p in the `frame` (`pull` or `push`) [mm/s]."""
        drive = self.drive(self.p)
        return self.through(frame, lambda material, frame: (-laws.permeability(self.J, material) * (frame * drive),))[0]

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration; `OUTPUT_UNITS` has their units."""
        return {**self.solid_outputs(self.p), "p": self.p, "seepage": self.seepage(self.push)}


@dataclass(frozen=True)
class Uncharged(OnePressure):
    """Unknowns u (order k) and p (order k − 1): the concentration model for cfc0 = 0, whose salt then only drifts along."""

    unknowns: ClassVar[tuple[str, ...]] = ("u", "p")
    balanced: ClassVar[dict[str, str]] = {"fluid": "p"}
    evolving: ClassVar[dict[str, float]] = {"u": 1e-2, "p": 1e-1}

    def check(self, material: Material, baths: Sequence[BathData]) -> None:
        if not isinstance(material.cfc0, (int, float)) or material.cfc0 != 0:
            value = f"{material.cfc0:g}" if isinstance(material.cfc0, (int, float)) else "a field"
            remedy = "use Potential, Concentration or LocalDonnan"
            raise InputError(f"Uncharged: the material has cfc0 other than 0 ({value}, mol/l); {remedy}")
        for bath in baths:
            if bath.salt is not None:
                raise InputError(f"bath on {bath.boundary!r}: Uncharged has no ions, so it takes no concentration c")

    def state(self, functions: Sequence[CoefficientFunction], context: FieldContext) -> State:
        return State(context, *functions)
