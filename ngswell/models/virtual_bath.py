"""Ions and overall pressure of a point that is in Donnan equilibrium with a bath of its own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ngsolve import CoefficientFunction

from ngswell.models.solid_state import SolidState
from ngswell.physics import donnan


@dataclass(frozen=True)
class VirtualBathState(SolidState):
    """Displacement, and the bath (P, c̃) with which the point would be in equilibrium; the ions follow from its charge."""

    P: CoefficientFunction
    salt: CoefficientFunction

    @cached_property
    def pore_pressure(self) -> CoefficientFunction:
        """Overall pressure p = P + 2 Rθ [φ sqrt((Γ c̃)² + cfc²/4) − φ̄ c̃], eq. (38) [N/mm²]."""
        m = self.material
        return donnan.pressure(self.salt, self.pointwise_charge, m.RT, self.P, m.Gamma, m.phi, m.phi_bath)

    @cached_property
    def cations(self) -> CoefficientFunction:
        """c₊ of (23)₁ for that bath [mol/l]."""
        return donnan.cations(self.salt, self.pointwise_charge, self.material.Gamma)

    @cached_property
    def anions(self) -> CoefficientFunction:
        """c₋ [mol/l]."""
        return donnan.anions(self.salt, self.pointwise_charge, self.material.Gamma)

    def ion_outputs(self) -> dict[str, CoefficientFunction]:
        """Solid, pressures and ions."""
        return {
            **self.solid_outputs(self.pore_pressure),
            "p": self.pore_pressure,
            "fluid_potential": self.P - 2 * self.material.phi_bath * self.material.RT * self.salt,
            "c_plus": self.cations,
            "c_minus": self.anions,
            "cfc": self.pointwise_charge,
        }
