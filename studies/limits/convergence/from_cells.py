"""A scene whose bath integrals are evaluated from the cells beside the boundary.

The charge at the point needs J and so the whole of Grad u, of which an integral over the boundary itself knows the
tangential part alone.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cached_property
from typing import Any

from ngsolve import CoefficientFunction, Cof, Grad, Id, Norm, specialcf

from ngswell import PlaneStrain, Scene
from ngswell.models.model import Model, Term
from ngswell.problem.problem import Problem


class _FullGradient(PlaneStrain):
    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        return Norm(Cof(Id(2) + Grad(u)) * specialcf.normal(2))


class _FromCells(Problem):
    def _boundary_terms(self, *given: Any) -> list[Term]:
        return [replace(term, normal_derivatives=term.name == "efflux") for term in super()._boundary_terms(*given)]


class _SceneFromCells(Scene):
    @cached_property
    def problem(self) -> Problem:
        return _FromCells(self)


def from_cells(scene: Scene, model: Model) -> Scene:
    """The plane scene with a model whose baths need the whole of Grad u."""
    parts = {part.name: getattr(scene, part.name) for part in fields(scene)}
    return _SceneFromCells(**parts | {"model": model, "kinematics": _FullGradient()})
