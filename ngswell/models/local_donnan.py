"""Ions everywhere in equilibrium with one bath (the Lanir assumption): displacement and one pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from ngsolve import CoefficientFunction

from ngswell.errors import InputError
from ngswell.models.model import BathData, FieldContext, needs_ions
from ngswell.models.one_pressure import OnePressure
from ngswell.models.virtual_bath import VirtualBathState
from ngswell.physics import laws
from ngswell.physics.material import Material


@dataclass(frozen=True)
class State(VirtualBathState):
    """Displacement and hydraulic pressure P; the ions follow from the charge at the point and the one bath."""

    @property
    def pressure(self) -> CoefficientFunction:
        """What a bath prescribes [N/mm²]."""
        return self.P

    def seepage(self, frame: CoefficientFunction) -> CoefficientFunction:
        """nF wF = −K grad P / (1 + K Rθ cfc² / [nF (D₊ c₊ + D₋ c₋)]) in the `frame` (`pull` or `push`) [mm/s].

        Fluid that drags its charge along builds up a streaming potential; zero current (21) with uniform salt makes it
        a smaller permeability. K and D± are those of the material's laws.
        """
        drive, cfc = self.drive(self.P), self.pointwise_charge
        D_plus, D_minus = laws.diffusivities(self.nF, self.material)
        conductance = D_plus * self.cations + D_minus * self.anions

        def flux(material: Material, frame: CoefficientFunction) -> tuple[CoefficientFunction]:
            K = laws.permeability(self.J, material)
            drag = K * material.RT * cfc * cfc / (self.nF * conductance)
            return (-K / (1 + drag) * (frame * drive),)

        return self.through(frame, flux)[0]

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration; `OUTPUT_UNITS` has their units."""
        return {**self.ion_outputs(), "seepage": self.seepage(self.push)}


@dataclass(frozen=True)
class LocalDonnan(OnePressure):
    """Unknowns u (order k) and hydraulic pressure P (order k − 1); the limit of fast ion diffusion in the full model.

    The ions follow the bath at once, at the start too: a bath that differs from the scene's `initial` is a sudden change.
    """

    unknowns: ClassVar[tuple[str, ...]] = ("u", "P")
    balanced: ClassVar[dict[str, str]] = {"fluid": "P"}
    evolving: ClassVar[dict[str, float]] = {"u": 1e-2, "P": 1e-1}

    def check(self, material: Material, baths: Sequence[BathData]) -> None:
        needs_ions("LocalDonnan", material)
        if not baths or any(bath.salt is None for bath in baths):
            raise InputError("LocalDonnan needs a bath with its salt concentration c [mol/l]")
        for bath in baths:
            if not bath.salt.uniform:
                raise InputError(
                    f"bath on {bath.boundary!r}: its concentration varies in space, but LocalDonnan has the ions in "
                    "equilibrium with one bath; use Potential or Concentration"
                )
        for bath in baths[1:]:
            if bath.salt != baths[0].salt:
                raise InputError(
                    f"baths on {baths[0].boundary!r} and {bath.boundary!r} differ in concentration: "
                    "LocalDonnan has the ions in equilibrium with one bath; use Potential or Concentration"
                )

    def state(self, functions: Sequence[CoefficientFunction], context: FieldContext) -> State:
        assert context.bath is not None, "the model refuses scenes without a bath"
        u, P = functions
        return State(context, u, P, context.bath.salt)
