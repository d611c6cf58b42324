"""How finely terms are integrated, and where bounds are looked at."""

from __future__ import annotations

from ngsolve import ET, VOL, IntegrationRule, Mesh
from numpy.typing import NDArray

from ngswell.mesh.points import rules

BONUS_ORDER = 2
"""Extra integration order: the pulled-back terms are rational in F."""

BONUS_IN_SPACE = 1
"""The same over cells in space: 27 points a hexahedron in place of 64, which halves the time of tangents.

Errors stay those of the fields: a swelling block's volume moves by 1e-7 to 1e-9 where its error is 1e-2 to 1e-3. In the
plane the finer rule is kept for bonded edges, where the strain is singular and fewer points see less of it.
"""


def over_body(order: int, mesh: Mesh) -> dict[ET, IntegrationRule]:
    """The rules of all forms over the body, whatever terms they have, for displacements of that order."""
    return rules(2 * order + (BONUS_IN_SPACE if mesh.dim == 3 else BONUS_ORDER))


def watched(order: int, mesh: Mesh) -> NDArray:
    """Mapped points where bounds are looked at: as near to the sides of cells as any that is integrated at."""
    return mesh.MapToAllElements(rules(2 * order + BONUS_ORDER), VOL)
