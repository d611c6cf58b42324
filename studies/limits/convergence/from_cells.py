"""A penalty whose integrals are evaluated from the cells beside the boundary.

The charge at the point needs J and so the whole of Grad u, of which an integral over the boundary itself knows the
tangential part alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ngswell import Penalty, Scene, Term
from ngswell.baths.treatment import Contact
from ngswell.models.model import Model


@dataclass(frozen=True)
class PenaltyFromCells(Penalty):
    """The paper's penalty, with all derivatives."""

    def terms(self, contact: Contact) -> list[Term]:
        return contact.effluxes(*self.factors(contact), in_cells=True)


def from_cells(scene: Scene, model: Model) -> Scene:
    """The scene with a model whose baths need the whole of Grad u."""
    baths = []
    for bath in scene.baths:
        penalty = scene.treatment(bath)
        assert isinstance(penalty, Penalty), "the free-swelling scene has the paper's penalty"
        baths.append(replace(bath, treatment=PenaltyFromCells(penalty.epsilon, penalty.relative)))
    return replace(scene, model=model, baths=baths)
