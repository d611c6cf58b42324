"""What every rank runs: scenes and tasks by name; the first writes what came out.

mpirun -n 2 python -m tests.ranks.worker OUT "cube, potential" ...
"""

from __future__ import annotations

import pickle
import sys

from ngswell.team import everyone
from tests.ranks.tasks import outcome

found = {name: outcome(name) for name in sys.argv[2:]}
if everyone().rank == 0:
    with open(sys.argv[1], "wb") as file:
        pickle.dump(found, file)
