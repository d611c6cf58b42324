"""What every rank runs: scenes by name, for a number of ranks; the first writes what came out.

mpirun -n 2 python -m tests.ranks.worker OUT "cube, potential" ...
"""

from __future__ import annotations

import pickle
import sys
import warnings
from typing import Any

from ngswell import InstabilityWarning, Ledger
from ngswell.team import everyone
from tests.ranks.scenes import SCENES


def outcome(name: str) -> dict[str, Any]:
    """Fields at the end, accepted steps with their iterations, and what the ledger says, of the scene `name`."""
    make, steps, until = SCENES[name]
    ledger = Ledger()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InstabilityWarning)  # some are, as a body under dead loads may be
        result = make(ranks=True).run(until, steps, [ledger])
    return {
        "values": result.end.values,
        "steps": [(step.time, step.iterations) for step in result.steps],
        "fluid": ledger.fluid,
    }


if __name__ == "__main__":
    found = {name: outcome(name) for name in sys.argv[2:]}
    if everyone().rank == 0:
        with open(sys.argv[1], "wb") as file:
            pickle.dump(found, file)
