"""Directions in the reference configuration, as fibres and permeabilities have them: three components in every motion."""

from __future__ import annotations

from typing import Any

import numpy as np
from ngsolve import CF, VOL, CoefficientFunction, Mesh, Norm

from ngswell import checks
from ngswell.errors import InputError
from ngswell.mesh.points import points

NO_LENGTH = 1e-9
"""Share of the greatest length of a field of directions that is none."""


def direction(what: str, value: Any) -> Any:
    """Three numbers or a field of three components; InputError for what is neither, or has no length."""
    example = "three components, such as (0, 0, 1), or a field of them"
    if isinstance(value, CoefficientFunction):
        if value.dim != 3 or value.is_complex:
            raise InputError(f"{what} has to be real with {example}, got {value.dim}")
        return value
    components = checks.vector(what, value, 1e6)
    if len(components) != 3:
        raise InputError(f"{what} has to have {example}, got {checks.short(value)}")
    if not np.linalg.norm(components) > 1e-6:
        raise InputError(f"{what} {components} has no length; give {example}")
    return components


def unit(value: Any) -> CoefficientFunction:
    """The direction with length 1."""
    vector = CF(value)
    return vector / Norm(vector)


def check_length(what: str, value: Any, mesh: Mesh) -> None:
    """Refuse a field of directions that has no length, or none that is finite, at a quadrature point of `mesh`."""
    lengths = Norm(CF(value))(points(mesh, VOL, 4)).ravel()
    if not lengths.min() > NO_LENGTH * lengths.max():
        raise InputError(f"{what} has the length {lengths.min():g} at a point of the body; give it a direction there")
