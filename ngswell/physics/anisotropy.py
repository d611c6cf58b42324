"""Permeabilities that depend on direction: channels along and across material lines and planes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from ngsolve import CF, VOL, CoefficientFunction, InnerProduct, Inv, Mesh, OuterProduct

from ngswell import checks
from ngswell.checks import Field
from ngswell.errors import InputError
from ngswell.mesh.points import points
from ngswell.physics.directions import check_length, direction, unit
from ngswell.physics.pores import Constant, Permeability

MOST = 1e6
"""Largest ratio of permeabilities."""


class Channel(NamedTuple):
    """A direction q of the deformed body with a permeability of its own: `ratio` times K, and Fᵀ (q⊗q) F⁻ᵀ, 3 × 3."""

    ratio: float
    projection: CoefficientFunction


@runtime_checkable
class Directional(Protocol):
    """A `Permeability` that depends on direction: (K0, J, nS0) gives K, and `channels` gives the directions, at right angles
    to each other in the deformed body, whose permeability is another multiple of it."""

    def __call__(self, K0: Field, J: Field, nS0: Field, /) -> Field: ...

    def channels(self, F: CoefficientFunction, /) -> list[Channel]: ...


@dataclass(frozen=True)
class TransverselyIsotropic:
    """Permeability `ratio` K along the material lines of `axis` N, K across: K [I + (ratio − 1) q⊗q], q = FN/|FN|.

    K is the material's with `law`, over J. N is as in `Fibres`. After G. A. Ateshian and J. A. Weiss, J. Biomech. Eng. 132
    (2010) 111004: what is transversely isotropic stays so about the line that the deformation carries along.
    """

    axis: Any
    ratio: float
    law: Permeability = Constant()

    def __post_init__(self) -> None:
        axis = direction("TransverselyIsotropic: axis", self.axis)
        checks.set_fields(self, axis=axis, ratio=_ratio("TransverselyIsotropic: ratio", self.ratio))

    def __call__(self, K0: Field, J: Field, nS0: Field) -> Field:
        return self.law(K0, J, nS0)

    def channels(self, F: CoefficientFunction) -> list[Channel]:
        return [Channel(self.ratio, _along(F, unit(self.axis)))]

    def check_on(self, mesh: Mesh) -> None:
        check_length("TransverselyIsotropic: axis", self.axis, mesh)


@dataclass(frozen=True)
class Orthotropic:
    """Permeability `along` times K along the material lines of `axis` N, `through` times K through the material planes whose
    `normal` is M, at right angles to N, and K in those planes across the lines:

        K [I + (along − 1) q⊗q + (through − 1) m⊗m],   q = FN/|FN|,   m = F⁻ᵀM/|F⁻ᵀM|.

    K is the material's with `law`, over J. With `along` = 1, beds or lamellae that are alike in all directions of their
    planes. q and m stay at right angles, so K stays positive.
    """

    axis: Any
    normal: Any
    along: float
    through: float
    law: Permeability = Constant()

    def __post_init__(self) -> None:
        checks.set_fields(
            self,
            axis=direction("Orthotropic: axis", self.axis),
            normal=direction("Orthotropic: normal", self.normal),
            along=_ratio("Orthotropic: along", self.along),
            through=_ratio("Orthotropic: through", self.through),
        )
        if not any(isinstance(field, CoefficientFunction) for field in (self.axis, self.normal)):
            _check_right(float(np.dot(self.axis, self.normal) / np.linalg.norm(self.axis) / np.linalg.norm(self.normal)))

    def __call__(self, K0: Field, J: Field, nS0: Field) -> Field:
        return self.law(K0, J, nS0)

    def channels(self, F: CoefficientFunction) -> list[Channel]:
        M = unit(self.normal)
        pulled = Inv(F.trans * F) * M
        through = OuterProduct(M, pulled) / InnerProduct(M, pulled)
        return [Channel(self.along, _along(F, unit(self.axis))), Channel(self.through, through)]

    def check_on(self, mesh: Mesh) -> None:
        check_length("Orthotropic: axis", self.axis, mesh)
        check_length("Orthotropic: normal", self.normal, mesh)
        _check_right(float(abs(InnerProduct(unit(self.axis), unit(self.normal))(points(mesh, VOL, 4))).max()))


def ratios(law: object) -> tuple[float, ...]:
    """The multiples of K that a law has beside K itself; none if it does not depend on direction."""
    if not isinstance(law, Directional):
        return ()
    return tuple(channel.ratio for channel in law.channels(CF((1, 0, 0, 0, 1, 0, 0, 0, 1), dims=(3, 3))))


def _along(F: CoefficientFunction, N: CoefficientFunction) -> CoefficientFunction:
    """Fᵀ (q⊗q) F⁻ᵀ = CN⊗N/(N·CN)."""
    CN = F.trans * (F * N)
    return OuterProduct(CN, N) / InnerProduct(N, CN)


def _ratio(what: str, value: Any) -> float:
    return checks.number(what, value, "", 1 / MOST, MOST, "a multiple of K")


def _check_right(cosine: float) -> None:
    if not abs(cosine) <= 1e-6:
        raise InputError(f"Orthotropic: axis and normal have to be at right angles, their cosine is {cosine:.3g}")
