"""Records and steps that go to files: the same numbers, no memory, and what goes on from a checkpoint."""

import gc
import pickle
import tracemalloc

import numpy as np
import pytest

from ngswell import (
    CSV,
    Adaptive,
    Area,
    Checkpoint,
    Concentration,
    Fixed,
    InputError,
    Integral,
    Ledger,
    Observer,
    Outflow,
    OutputError,
    Potential,
    Probe,
    Progress,
    Ramp,
)
from tests.scenes import FALLING, confined_column, strip


def gel(c=FALLING, **changes):
    return confined_column(None, c, **{"model": Potential(), "cells": 3, **changes})


def watched(folder=None, where=(0.5,), overwrite=False):
    """Every observer that writes its records, to the memory or to a folder."""

    def to(name):
        return None if folder is None else CSV(folder / name, overwrite)

    return [
        Probe(where, "J", "displacement", "stress", to=to("probe.csv")),
        Ledger(to=to("ledger.csv")),
        Integral("p", to=to("integral.csv")),
        Area(when=5.0, to=to("area.csv")),
        Outflow("top", where, to=to("outflow.csv")),
        Outflow("top", to=to("whole.csv")),
        Progress(),
    ]


def numbers(observers, result):
    probe, ledger, integral, area, outflow, whole, _ = observers
    return [
        *probe.values.values(), ledger.fluid, ledger.cations, ledger.fluid_left["top"], ledger.cations_left["top"],
        np.array(list(ledger.imbalance().values())), integral.values, area.values, outflow.fluid, outflow.fluid_at,
        outflow.cations_at, whole.cations, whole.fluid_at, *(o.time for o in observers[:-1]), result.end.values,
        np.array([step.time for step in result.steps]), np.array(result.iterations),
    ]  # fmt: skip


def check_equal(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b, strict=True)


def at_points(scene):
    return (0.5,) if scene.mesh.dim == 1 else (0.0, 0.5)


@pytest.mark.parametrize("make", [gel, lambda: strip(None, FALLING, (1, 3), model=Potential())], ids=["1-d", "2-d"])
def test_files_hold_the_same_numbers_to_the_bit(make, tmp_path):
    where = at_points(make())
    here, there = watched(where=where), watched(tmp_path, where)
    one = make().run(20.0, Adaptive(1e-3), here)
    other = make().run(20.0, Adaptive(1e-3), there, log=tmp_path / "steps.csv")
    check_equal(numbers(here, one), numbers(there, other))
    assert one.steps == other.steps
    assert other.summary().startswith(one.summary().partition(" Newton")[0])
    assert pickle.loads(pickle.dumps(other.steps)) == one.steps
    columns = CSV(tmp_path / "probe.csv").read()
    assert list(columns)[:3] == ["time [s]", "J [-]", "displacement [mm]" if where == (0.5,) else "displacement 1 [mm]"]
    np.testing.assert_array_equal(columns["J [-]"], here[0].values["J"])
    assert not [file for file in tmp_path.iterdir() if file.suffix != ".csv"]  # locks are gone


def test_rejected_steps_are_in_the_file_too(tmp_path):
    sudden = gel(Ramp((0, 0.15), (10, 0.15), (10.01, 0.08)), model=Concentration(), cells=8)
    result = sudden.run(20.0, Adaptive(1e-4), log=tmp_path / "steps.csv")
    assert result.rejections == sum(len(step.rejected) for step in result.steps) > 0
    assert result.steps == sudden.run(20.0, Adaptive(1e-4)).steps


KEEPERS = [tracemalloc.Filter(True, f"*/ngswell/{where}") for where in ("observers/*", "run/*", "stepping/*", "streams.py")]
"""Where anything of a step could be kept. Elsewhere Python tidies up behind NGSolve's objects when it likes."""


class Memory(Observer):
    """Traced memory and size of the checkpoint [bytes] after 100, 200 … 500 steps."""

    def __init__(self, checkpoint):
        super().__init__()
        self.checkpoint, self.seen = checkpoint, []

    def observe(self, problem, step):
        if round(step.time) % 100 == 0:
            gc.collect()
            kept = tracemalloc.take_snapshot().filter_traces(KEEPERS).statistics("filename")
            self.seen.append((sum(entry.size for entry in kept), self.checkpoint.path.stat().st_size))


@pytest.mark.parametrize("in_files", [True, False])
def test_memory_and_checkpoints_do_not_grow(in_files, tmp_path):
    """In the memory a step takes 8 bytes for each number recorded, 25 here, and 200 of its own. Over 1.6e4 steps that went
    to files the process grew by nothing but one resized table of Python's, which shows in one hundred steps of the four."""
    checkpoint = Checkpoint(tmp_path / "run", when=50.0)
    probe, ledger, integral, *_, progress = watched(tmp_path if in_files else None)
    memory, log = Memory(checkpoint), tmp_path / "steps.csv" if in_files else None
    tracemalloc.start()
    try:
        watchers = [probe, ledger, integral, progress, memory]
        gel(Ramp((0, 0.15), (501, 0.1))).run(501.0, Fixed(1.0), watchers, checkpoint=checkpoint, log=log, unstable="off")
    finally:
        tracemalloc.stop()
    memories, checkpoints = np.array(memory.seen).T
    # What is kept grows in every hundred steps, what Python has not let go of in the first.
    traced, kept = np.diff(memories).min() / 100, (checkpoints[-1] - checkpoints[0]) / 400
    if in_files:
        assert traced < 60.0  # bytes a step: some 10 kB of NGSolve's values that Python has not let go of
        assert kept < 0.1  # the seconds that the run took have more digits or fewer
    else:
        assert traced > 200.0
        assert kept > 150.0


# -- what goes on --------------------------------------------------------------------------------------------------------


def run(folder, until, overwrite=False, **more):
    observers = watched(folder, overwrite=overwrite)
    log = {"log": CSV(folder / "steps.csv", overwrite), "checkpoint": Checkpoint(folder / "run", every=0.0)}
    return observers, gel().run(until, Fixed(2.0), observers, **{**log, **more})


@pytest.fixture
def whole(tmp_path):
    (tmp_path / "whole").mkdir()
    observers, result = run(tmp_path / "whole", 20.0)
    return numbers(observers, result)


def test_a_run_goes_on_with_its_files_and_drops_what_lies_beyond_its_checkpoint(whole, tmp_path):
    folder = tmp_path / "part"
    folder.mkdir()
    run(folder, 10.0)
    for file in folder.glob("*.csv"):
        with open(file, "a") as more:
            more.write("12.0,999.0,99")  # of a step whose checkpoint was not reached, cut short
    assert CSV(folder / "whole.csv").read()["time [s]"][-1] == 10.0
    observers, result = run(folder, 20.0)
    check_equal(numbers(observers, result), whole)
    for file in folder.glob("*.csv"):
        assert file.read_bytes() == (tmp_path / "whole" / file.name).read_bytes()
    assert run(folder, 20.0)[1].steps == result.steps  # over already


@pytest.mark.parametrize("name", ["ledger.csv", "steps.csv"])
def test_files_that_changed_are_refused(name, tmp_path):
    run(tmp_path, 10.0)
    file, before = tmp_path / name, (tmp_path / name).read_bytes()
    random = np.random.default_rng(0)
    for place in random.integers(0, 8 * len(before), 20):
        wrong = bytearray(before)
        wrong[place // 8] ^= 1 << (place % 8)
        file.write_bytes(wrong)
        with pytest.raises(InputError, match=rf"{name} is not as it was at the checkpoint; put it back"):
            run(tmp_path, 20.0)
    for wrong in (before[:-1], b""):
        file.write_bytes(wrong)
        with pytest.raises(InputError, match="not as it was"):
            run(tmp_path, 20.0)
    file.unlink()
    with pytest.raises(InputError, match="not as it was"):
        run(tmp_path, 20.0)
    file.write_bytes(before)
    run(tmp_path, 20.0)


def test_steps_move_from_the_memory_to_a_file_but_not_back(whole, tmp_path):
    folder = tmp_path / "moved"
    folder.mkdir()
    run(folder, 10.0, log=None)
    observers, result = run(folder, 20.0)
    check_equal(numbers(observers, result), whole)
    with pytest.raises(InputError, match="kept its steps in a file; give it as log= again"):
        run(folder, 30.0, log=None)
    with pytest.raises(InputError, match="has the observers"):
        gel().run(30.0, Fixed(2.0), watched(), checkpoint=Checkpoint(folder / "run"))


# -- refusals ------------------------------------------------------------------------------------------------------------


def never(time, state):
    raise AssertionError("the run has begun")


def test_files_that_cannot_be_written_are_refused_before_computing(tmp_path):
    (tmp_path / "there.csv").write_text("before")
    (tmp_path / "folder.csv").mkdir()
    for path, said in (
        (tmp_path / "none" / "J.csv", "there is no folder"),
        (tmp_path / "there.csv", r"exists; choose another name or pass overwrite=True to CSV"),
        (tmp_path / "folder.csv", "is a folder"),
    ):
        with pytest.raises(OutputError, match=rf"Probe: .*{said}"):
            gel().run(2.0, Fixed(2.0), [Probe((0.5,), "J", to=path), never])
        with pytest.raises(OutputError, match=rf"run: log: .*{said}"):
            gel().run(2.0, Fixed(2.0), log=path)
    assert (tmp_path / "there.csv").read_text() == "before"
    with pytest.raises(OutputError, match="another run or observer is writing"):
        gel().run(2.0, Fixed(2.0), [Area(to=tmp_path / "A.csv"), Integral(to=CSV(tmp_path / "A.csv", overwrite=True))])
    for wrong in (3, ""):
        with pytest.raises(InputError, match="path has to be a file's"):
            Ledger(to=wrong)
        with pytest.raises(InputError, match="path has to be a file's"):
            gel().run(2.0, log=wrong)
    with pytest.raises(InputError, match="there is no file"):
        CSV(tmp_path / "nothing.csv").read()
    (tmp_path / "there.csv").write_text("a,b\n1.0,x\n")
    with pytest.raises(InputError, match="damaged"):
        CSV(tmp_path / "there.csv").read()


def test_overwriting_starts_anew_and_links_stay(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "J.csv").symlink_to(tmp_path / "disk" / "J.csv")
    for _ in range(2):
        gel().run(4.0, Fixed(2.0), [Probe((0.5,), "J", to=CSV(tmp_path / "J.csv", overwrite=True))])
    assert (tmp_path / "J.csv").is_symlink()
    assert CSV(tmp_path / "disk" / "J.csv").read()["time [s]"].tolist() == [0.0, 2.0, 4.0]


def test_records_stay_when_a_run_stops(tmp_path):
    area = Area(to=tmp_path / "area.csv")
    scene = gel(Ramp((0, 0.15), (1000, 0.1)))
    with pytest.raises(ZeroDivisionError):
        scene.run(20.0, Fixed(2.0), [area, lambda time, state: 1 / (time - 10.0)])
    assert area.time.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
