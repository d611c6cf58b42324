"""Rigid shapes: what an obstacle is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from ngsolve import CF, CoefficientFunction, InnerProduct, Norm

from ngswell import checks
from ngswell.errors import InputError
from ngswell.physics.kinematics import Kinematics

FARTHEST = 1e6
"""Places beyond this [mm] are none that can be meant."""

SHORTEST = 1e-9
"""Length of a direction below which it is none."""


@runtime_checkable
class Shape(Protocol):
    """A rigid body that does not deform or turn. One of your own gives, numbered:

    1. `at`, a point of it [mm], from which it is measured;
    2. `check`, its refusals: motions in which it has no meaning;
    3. `gap`: the distance [mm] of what is at `r` [mm] as seen from `at`, negative inside, and its gradient.
    """

    at: tuple[float, ...]

    def check(self, kinematics: Kinematics) -> None: ...

    def gap(self, r: CoefficientFunction) -> tuple[CoefficientFunction, CoefficientFunction]: ...


@dataclass(frozen=True)
class RigidPlane(Shape):
    """A half-space behind a plane through `at` [mm]; `normal` points out of it, to the side of the body.

    In a column a plate, `RigidPlane((1.2,), (-1.0,))`; axisymmetric with the normal along r a ring or a rod.
    """

    at: tuple[float, ...]
    normal: tuple[float, ...]

    def __post_init__(self) -> None:
        checks.set_fields(
            self,
            at=checks.vector("RigidPlane: at", self.at, FARTHEST, "mm"),
            normal=checks.vector("RigidPlane: normal", self.normal, FARTHEST),
        )
        _check_direction("RigidPlane: normal", self.normal, self.at)

    def check(self, kinematics: Kinematics) -> None:
        pass

    def gap(self, r: CoefficientFunction) -> tuple[CoefficientFunction, CoefficientFunction]:
        normal = CF(tuple(np.array(self.normal) / np.linalg.norm(self.normal)))
        return InnerProduct(normal, r), normal


@dataclass(frozen=True)
class RigidSphere(Shape):
    """A ball about `at` with a `radius` [mm]: in space, or on the axis of an axisymmetric body."""

    at: tuple[float, ...]
    radius: float

    def __post_init__(self) -> None:
        checks.set_fields(
            self,
            at=checks.vector("RigidSphere: at", self.at, FARTHEST, "mm"),
            radius=checks.positive("RigidSphere: radius", self.radius, "mm"),
        )

    def check(self, kinematics: Kinematics) -> None:
        if kinematics.dimension == 1:
            raise InputError("RigidSphere: a column meets a RigidPlane(at, normal), such as RigidPlane((1.2,), (-1.0,))")
        if kinematics.dimension == kinematics.power == 2:
            raise InputError("RigidSphere: in plane strain take RigidCylinder(at, radius)")
        if kinematics.dimension == 2 and self.at[0] != 0.0:
            raise InputError(f"RigidSphere: axisymmetric it lies on the axis, at (0.0, z), not at r = {self.at[0]:g} mm")

    def gap(self, r: CoefficientFunction) -> tuple[CoefficientFunction, CoefficientFunction]:
        return Norm(r) - self.radius, r / Norm(r)


@dataclass(frozen=True)
class RigidCylinder(Shape):
    """A round bar with a `radius` [mm] whose axis passes `at`: across the plane in plane strain, along `axis` in space."""

    at: tuple[float, ...]
    radius: float
    axis: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        checks.set_fields(
            self,
            at=checks.vector("RigidCylinder: at", self.at, FARTHEST, "mm"),
            radius=checks.positive("RigidCylinder: radius", self.radius, "mm"),
        )
        if self.axis is not None:
            checks.set_fields(self, axis=checks.vector("RigidCylinder: axis", self.axis, FARTHEST))
            _check_direction("RigidCylinder: axis", self.axis, self.at)

    def check(self, kinematics: Kinematics) -> None:
        across = kinematics.dimension == kinematics.power == 2
        if kinematics.dimension == 3 and self.axis is None:
            raise InputError("RigidCylinder: in space it needs an axis, such as axis=(0.0, 1.0, 0.0)")
        if across and self.axis is not None:
            raise InputError("RigidCylinder: in plane strain its axis is across the plane; leave axis out")
        if kinematics.dimension != 3 and not across:
            raise InputError(
                "RigidCylinder: for plane strain and space; here take RigidPlane(at, normal) or RigidSphere(at, radius)"
            )

    def gap(self, r: CoefficientFunction) -> tuple[CoefficientFunction, CoefficientFunction]:
        if self.axis is not None:
            axis = CF(tuple(np.array(self.axis) / np.linalg.norm(self.axis)))
            r = r - InnerProduct(axis, r) * axis
        return Norm(r) - self.radius, r / Norm(r)


def _check_direction(what: str, direction: tuple[float, ...], at: tuple[float, ...]) -> None:
    """Refuse a direction without length, or in another space than the point `at`."""
    if not np.linalg.norm(direction) > SHORTEST:
        raise InputError(f"{what} {direction} has no length; give a direction, such as {(*(0.0,) * (len(at) - 1), 1.0)}")
    if len(direction) != len(at):
        raise InputError(f"{what} {direction} needs as many components as the point {at}")
