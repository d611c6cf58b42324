"""A fixed charge that a model cannot mean."""

from __future__ import annotations

from ngsolve import CoefficientFunction

from ngswell.errors import InputError
from ngswell.mesh.parts import Sides
from ngswell.models.model import Model
from ngswell.physics.material import Material

SMALL_JUMP = 0.1
"""Jump of cfc0, as a share of its largest value, below which `Concentration` is off by less than 1e-4."""


def check_jumps(material: Material, model: Model, sides: Sides) -> None:
    """Refuse a charge that jumps where the model has a continuous field for it: no mesh brings it to the right rest."""
    charge = material.cfc0
    if model.charge_field is None or not isinstance(charge, CoefficientFunction):
        return
    if sides.jumps(charge, SMALL_JUMP):
        raise InputError(
            f"cfc0 jumps from cell to cell, but {type(model).__name__} has one continuous field for the charge and "
            "comes to rest elsewhere on every mesh, by percents: take Potential() or LocalDonnan(), which are exact"
        )
