"""Sets of unknowns: each gives its spaces and its residual as named terms."""

from ngswell.models.concentration import Concentration
from ngswell.models.terms import Term

__all__ = ["Concentration", "Term"]
