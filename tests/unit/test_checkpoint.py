"""Checkpoints: what a resumed run repeats, what files and scenes are refused, what a failed write leaves."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import ngsolve
import numpy as np
import pytest
from conftest import confined_column, strip

import ngswell
from ngswell import (
    BACKWARD_EULER,
    VTK,
    Adaptive,
    Area,
    Bath,
    Checkpoint,
    Coarseness,
    Concentration,
    Fixed,
    Frozen,
    InputError,
    Integral,
    Lagged,
    Ledger,
    Multiplier,
    OutputError,
    Potential,
    Probe,
    Progress,
    Ramp,
    Snapshots,
    StepError,
    TwoLevelSolver,
    read_checkpoint,
)
from ngswell.observers import Observer
from ngswell.solvers import CondensedSolver, LinearSolver, best_solver

FALLING = Ramp((0, 0.15), (10, 0.125))


@pytest.fixture
def one_thread():
    """Two runs with several threads differ in the last digits, interrupted or not."""
    threads = ngsolve.GetNumThreads()
    ngsolve.SetNumThreads(1)
    yield
    ngsolve.SetNumThreads(threads)


class Collect(Observer):
    """Copies of the file, one a step: what kills after each step leave."""

    def __init__(self, path):
        super().__init__()
        self.path, self.copies = path, []

    def record(self, problem, time):
        if self.path.exists():
            self.copies.append(self.path.with_name(f"copy{len(self.copies)}"))
            self.copies[-1].write_bytes(self.path.read_bytes())


def direct(name):
    def make(problem):
        if problem.condensed is None:
            return LinearSolver(problem.free, name)
        return CondensedSolver(problem.condensed, problem.free, name)

    return make


def watched(dimension):
    """One observer of each kind that a column or a strip can have."""
    end = (0.5,) if dimension == 1 else (0.0, 0.5)
    return [
        Probe(end, "displacement", "J", "p"), Probe(end, "c_plus", when=7.0), Integral("p"), Integral(boundary="top"),
        Area(), Ledger(), Coarseness(), Snapshots([0.0, 3.0, 15.0, 39.0]), Progress(),
    ]  # fmt: skip


def series(observers):
    """All that was recorded, as one dictionary of arrays; what the clock says left out."""
    found = {}
    for number, observer in enumerate(observers):
        found |= {f"{number} time": observer.time}
        found |= {f"{number} {key}": value for key, value in observer.memory().items() if key != "counts"}
    return found


def check_equal(one, other):
    assert one.keys() == other.keys()
    for key, value in one.items():
        np.testing.assert_array_equal(value, other[key], err_msg=key)


SUDDEN = Ramp((0, 0.15), (10, 0.15), (10.01, 0.08))
CASES = {
    "potential": (dict(treatment=None, model=Potential(), c=FALLING), Adaptive(1e-3)),
    "potential, tight": (dict(treatment=None, model=Potential(3), c=FALLING), Adaptive(1e-5)),
    "rejections": (dict(treatment=None, model=Potential(), c=SUDDEN), Adaptive(1e-4)),
    "concentration": (dict(model=Concentration(), c=FALLING), Adaptive(1e-3)),
    "multiplier": (dict(treatment=Multiplier(), model=Concentration(), c=FALLING), Adaptive(1e-3)),
    "backward Euler": (dict(treatment=None, model=Potential(), c=SUDDEN), Adaptive(1e-2, scheme=BACKWARD_EULER)),
    "fixed steps": (dict(model=Concentration(), c=FALLING), Fixed(4.0)),
    "lagged": (dict(treatment=Lagged(), model=Concentration(), c=FALLING), Fixed(4.0)),
    "frozen": (dict(treatment=Frozen(), model=Concentration(), c=FALLING), Adaptive(1e-2, scheme=BACKWARD_EULER)),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted({"umfpack", best_solver()}))
@pytest.mark.parametrize("case", CASES)
def test_a_run_resumed_after_any_of_its_steps_is_the_same_to_the_bit(case, name, tmp_path, one_thread):
    changes, steps = CASES[case]

    def run(observers, resume=None):
        return confined_column(cells=8, **changes).run(40.0, steps, observers, resume=resume, solver=direct(name))

    checkpoint, before = Checkpoint(tmp_path / "run", every=0.0), watched(1)
    copies = Collect(checkpoint.path)
    through = run([*before, copies, checkpoint])
    assert len(copies.copies) == len(through.steps)  # one from the start on; the last step's own is `checkpoint.path`
    if case == "rejections":
        assert through.rejections
    for path in [*copies.copies, checkpoint.path]:
        restart, observers = read_checkpoint(path), watched(1)
        resumed = run(observers, restart)
        assert resumed.end.time == through.end.time
        np.testing.assert_array_equal(resumed.end.values, through.end.values)
        assert resumed.steps == through.steps
        # The analysis and the kept matrix are made again: they do not count twice.
        assert (resumed.factorisations, resumed.solves) == (through.factorisations, through.solves)
        check_equal(series(observers), series(before))
