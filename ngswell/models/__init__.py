"""Sets of unknowns: each gives its spaces and its residual as named terms."""

from ngswell.models.concentration import Concentration
from ngswell.models.local_donnan import LocalDonnan
from ngswell.models.mechanics import OUTPUT_UNITS
from ngswell.models.potential import Potential
from ngswell.models.terms import Model, Term
from ngswell.models.uncharged import Uncharged

__all__ = ["OUTPUT_UNITS", "Concentration", "LocalDonnan", "Model", "Potential", "Term", "Uncharged"]
