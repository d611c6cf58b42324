"""Numbers of each unknown, for each of its coefficients."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray


def of_coefficients(ranges: Mapping[str, slice], numbers: Mapping[str, float]) -> NDArray:
    """A number for each unknown as one for each of its coefficients; `ranges` of the unknowns cover all coefficients."""
    found = np.empty(max(part.stop for part in ranges.values()))
    for name, part in ranges.items():
        found[part] = numbers[name]
    return found
