"""Ions everywhere in equilibrium with one bath (the Lanir assumption): displacement and one pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from ngsolve import CoefficientFunction

from ngswell.baths.bath import Bath, BathFields
from ngswell.errors import InputError
from ngswell.models.model import Setting
from ngswell.models.one_pressure import OnePressure
from ngswell.models.solid_state import SolidState
from ngswell.physics import donnan, laws
from ngswell.physics.material import Material
from ngswell.schedules import Blend


@dataclass(frozen=True)
class State(SolidState):
    """Displacement and hydraulic pressure P; the ions follow from the charge at the point and the bath."""

    P: CoefficientFunction

    @property
    def bath(self) -> BathFields:
        assert self.setting.bath is not None, "the model refuses scenes without a bath"
        return self.setting.bath

    @property
    def pressure(self) -> CoefficientFunction:
        """What a bath prescribes [N/mm²]."""
        return self.P

    @cached_property
    def pore_pressure(self) -> CoefficientFunction:
        """Overall pressure p = P + 2 Rθ [φ sqrt((Γ c̄)² + cfc²/4) − φ̄ c̄], eq. (38) [N/mm²]."""
        m = self.material
        return donnan.pressure(self.bath.c, self.pointwise_charge, m.RT, self.P, m.Gamma, m.phi, m.phi_bath)

    @cached_property
    def cations(self) -> CoefficientFunction:
        """c₊ of (23)₁ [mol/l]."""
        return donnan.cations(self.bath.c, self.pointwise_charge, self.material.Gamma)

    @cached_property
    def anions(self) -> CoefficientFunction:
        """c₋ = c₊ − cfc [mol/l]."""
        return donnan.anions(self.bath.c, self.pointwise_charge, self.material.Gamma)

    def seepage(self, frame: CoefficientFunction) -> CoefficientFunction:
        """nF wF = −K grad P / (1 + K Rθ cfc² / [nF (D₊ c₊ + D₋ c₋)]) in the `frame` (`pull` or `push`) [mm/s].

        Fluid that drags its charge along builds up a streaming potential; zero current (21) with uniform salt makes it
        a smaller permeability. K and D± are those of the material's laws.
        """
        K, cfc = self.permeability, self.pointwise_charge
        D_plus, D_minus = laws.diffusivities(self.nF, self.material)
        conductance = D_plus * self.cations + D_minus * self.anions
        drag = K * self.material.RT * cfc * cfc / (self.nF * conductance)
        return -K / (1 + drag) * (frame * self.drive(self.P))

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration; `ngswell.models.solid_state.OUTPUT_UNITS` has their units."""
        return {
            **self.solid_outputs(self.pore_pressure),
            "p": self.pore_pressure,
            "hydraulic_pressure": self.P - 2 * self.material.phi_bath * self.material.RT * self.bath.c,
            "c_plus": self.cations,
            "c_minus": self.anions,
            "cfc": self.pointwise_charge,
            "seepage": self.seepage(self.push),
        }


@dataclass(frozen=True)
class LocalDonnan(OnePressure):
    """Unknowns u (order k) and hydraulic pressure P (order k − 1); the limit of fast ion diffusion in the full model.

    The ions follow the bath at once, at the start too: a bath that differs from the scene's `initial` is a sudden change.
    """

    unknowns: ClassVar[tuple[str, ...]] = ("u", "P")
    held: ClassVar[dict[str, str]] = {"fluid": "P"}
    evolving: ClassVar[dict[str, float]] = {"u": 1e-2, "P": 1e-1}

    def check(self, material: Material, baths: Sequence[Bath]) -> None:
        if not baths or any(bath.c is None for bath in baths):
            raise InputError("LocalDonnan needs a bath with its salt concentration c [mol/l]")
        for bath in baths:
            if isinstance(bath.concentration, Blend):
                raise InputError(
                    f"bath on {bath.boundary!r}: its concentration varies in space, but LocalDonnan has the ions in "
                    "equilibrium with one bath; use Concentration"
                )
        for bath in baths[1:]:
            if bath.concentration != baths[0].concentration:
                raise InputError(
                    f"baths on {baths[0].boundary!r} and {bath.boundary!r} differ in concentration: "
                    "LocalDonnan has the ions in equilibrium with one bath; use Concentration"
                )

    def state(self, functions: Sequence[CoefficientFunction], setting: Setting) -> State:
        return State(setting, *functions)
