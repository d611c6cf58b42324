"""What a rank runs that writes: `python -m tests.ranks.runs FOLDER KILLED SIGNAL`; at 25 s a rank gets a signal."""

from __future__ import annotations

import os
import signal
import sys

import numpy as np

from ngswell import CSV, VTK, Checkpoint, Fixed, Ledger, Probe
from ngswell.team import everyone
from tests.scenes import FALLING, quarter

UNTIL = 50.0


def run(killed: int, by: signal.Signals) -> None:
    def kills(time: float, state: object) -> None:
        if time == 25.0 and everyone().rank == killed:
            os.kill(os.getpid(), by)

    probe, ledger = Probe((0.01, 0.22), "J", "p", to=CSV("probe.csv", overwrite=True)), Ledger()
    watched = [probe, ledger, VTK("series", "J", "p", when=10.0, overwrite=True), kills]
    checkpoint = Checkpoint("checkpoint", every=0.0)
    scene = quarter(None, FALLING, 5, ranks=True)
    result = scene.run(UNTIL, Fixed(5.0), watched, checkpoint=checkpoint, unstable="off", log=CSV("log.csv", True))
    ledger.to_csv("ledger.csv", overwrite=True)
    assert len(probe.time) == len(result.steps) + 1 == UNTIL / 5 + 1  # every rank reads them
    if everyone().rank == 0:
        np.save("end.npy", result.end.values)


if __name__ == "__main__":
    os.chdir(sys.argv[1])  # the names of files are settings of observers, which have to be the same
    run(int(sys.argv[2]), signal.Signals[sys.argv[3]])
