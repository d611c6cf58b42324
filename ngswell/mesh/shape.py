"""What tells whether a mesh is still the one that it was."""

from __future__ import annotations

from typing import NamedTuple
from zlib import crc32

from ngsolve import BND, VOL, Mesh

from ngswell.errors import InputError


class MeshShape(NamedTuple):
    """Numbers that change when a mesh is refined, curved, renamed, or when its points move."""

    cells: int
    sides: int
    vertices: int
    curve_order: int
    names: tuple[tuple[str, ...], ...]
    places: int

    @classmethod
    def of(cls, mesh: Mesh) -> MeshShape:
        """Those of a mesh. Raises InputError for one that NGSolve shows deformed: its points would be others everywhere."""
        if getattr(mesh, "deformation", None) is not None:
            raise InputError(
                "mesh: it has a deformation, but a scene is about the undeformed body: call mesh.UnsetDeformation() first"
            )
        names = tuple(mesh.GetBoundaries()), tuple(mesh.GetMaterials())
        places = crc32(mesh.ngmesh.Coordinates().tobytes())
        return cls(mesh.GetNE(VOL), mesh.GetNE(BND), mesh.nv, mesh.GetCurveOrder(), names, places)

    def check(self, mesh: Mesh) -> None:
        """Refuse a mesh that is not any more as it was."""
        now = MeshShape.of(mesh)
        if now == self:
            return
        changes = [("cells", self.cells, now.cells), ("order of the curved sides", self.curve_order, now.curve_order)]
        said = [f"{what} {before} then, {after} now" for what, before, after in changes if before != after]
        raise InputError(
            f"mesh: it has changed since the scene was made ({'; '.join(said) or 'points or names'}): make the scene after "
            "mesh.Refine(), mesh.Curve() and the like, and do not run an older one"
        )
