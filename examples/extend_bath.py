"""A treatment of a bath of one's own: a film with two permeances between gel and bath."""

from dataclasses import dataclass

from ngswell import Weak


@dataclass(frozen=True)
class Film(Weak):
    """Effluxes through a thin film: fluid L_p (p − p_D), cations L_s (c − c_D), per current area."""

    L_p: float  # [mm³/(N s)]
    L_s: float  # [mm/s]

    def __str__(self):
        return f"film, {self.L_p:g} mm³/(N s) for fluid, {self.L_s:g} mm/s for cations"

    def terms(self, contact):
        return contact.effluxes(fluid=self.L_p, cations=self.L_s)
