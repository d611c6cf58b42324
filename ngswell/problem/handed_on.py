"""What one part of a test hands on to the next."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ngswell.problem.discretisation import Discretisation
from ngswell.setup.snapshot import Snapshot


def handed_on(end: Snapshot, before: Discretisation, after: Discretisation, fresh: Collection[str] = ()) -> Snapshot:
    """`end`, of the part `before`, in the unknowns of the part `after`, at its start.

    Numbers that pieces bring go on where both parts have them; those that are new, or `fresh`, are at their start. Raises
    InputError for what no part `before` gave, for fields that are other ones, and for supports that hold the body elsewhere.
    """
    values, meaning = end.values, end.meaning
    if before.fields_meaning == after.fields_meaning and (before.numbers != after.numbers or fresh):
        before.check("after", end)
        meaning, values = after.meaning, np.zeros(after.space.ndof)
        for name in after.names:
            goes_on = name in before.ranges and name not in fresh
            values[after.ranges[name]] = end.values[before.ranges[name]] if goes_on else after.numbers[name].start
    taken = Snapshot(after.setup.start, values, meaning)
    after.check("after", taken)
    return taken
