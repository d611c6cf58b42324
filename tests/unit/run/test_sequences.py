"""Tests in several parts, and what must not be shared: snapshots of other scenes, observers, files, changed fields."""

import pickle
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import ngsolve
import numpy as np
import pytest
from ngsolve import Parameter

from ngswell import (
    VTK,
    Adaptive,
    Bath,
    Checkpoint,
    Fixed,
    InputError,
    Ledger,
    Material,
    OutputError,
    Penalty,
    Potential,
    Probe,
    Ramp,
    Roller,
    column,
    read_checkpoint,
)
from ngswell.files import replacing
from tests.scenes import FALLING, NUMBERS, confined_column, strip

LATER = [(20, 0.125), (30, 0.1)]


def gel(c=FALLING, **changes):
    return confined_column(None, c, **{"model": Potential(), "cells": 8, **changes})


@pytest.fixture(scope="module")
def first():
    ledger, scene = Ledger(), gel()
    return scene, scene.run(20.0, Fixed(2.0), [ledger]), ledger


@pytest.fixture(scope="module")
def whole():
    ledger = Ledger()
    return gel(Ramp((0, 0.15), (10, 0.125), *LATER)).run(40.0, Fixed(2.0), [ledger]), ledger


@pytest.mark.parametrize("start", [None, 0.0])
def test_two_parts_are_one_run(start, first, whole):
    scene, result, before = first
    shift, ledger = (0.0 if start is None else 20.0), Ledger()
    bath = Bath("top", c=Ramp(*((time - shift, c) for time, c in LATER)))
    end = scene.after(result, start=start, baths=[bath]).run(40.0 - shift, Fixed(2.0), [ledger]).end
    # Steps are the same and forget their past at kinks; what differs is the matrix that goes on: round-off of 0.1 N/mm².
    assert np.abs(end.values - whole[0].end.values).max() < 1e-14
    assert end.time == 40.0 - shift
    assert ledger.time[0] == 20.0 - shift
    assert ledger.fluid[0] == before.fluid[-1]
    left = before.fluid_left["top"][-1] + ledger.fluid_left["top"][-1]
    assert left == pytest.approx(whole[1].fluid_left["top"][-1], rel=1e-9)  # the nonlinear solves' tolerance
    assert np.abs(end.values - result.end.values).max() > 1e-3  # the second part does something


def test_adaptive_parts_agree_to_their_tolerance(whole):
    scene, steps = gel(), Adaptive(1e-4)
    through = gel(Ramp((0, 0.15), (10, 0.125), *LATER)).run(40.0, steps).end.values
    second = scene.after(scene.run(20.0, steps), baths=[Bath("top", c=Ramp(*LATER))])
    assert np.abs(second.run(40.0, steps).end.values - through).max() < 1e-4 * np.abs(through).max()


def test_the_second_part_keeps_its_own_checkpoint(first, tmp_path):
    scene, result, _ = first

    def second(until, **more):
        part = scene.after(result, baths=[Bath("top", c=Ramp(*LATER))])
        return part.run(until, Fixed(2.0), checkpoint=Checkpoint(tmp_path / "second", **more)).end.values

    through = second(40.0)
    second(30.0, overwrite=True)
    np.testing.assert_array_equal(second(40.0), through)
    with pytest.raises(InputError, match=r"of another scene: .*origin"):
        gel(Ramp(*LATER), start=20.0).run(40.0, checkpoint=Checkpoint(tmp_path / "second"))


def test_a_part_that_cannot_be_meant(first):
    scene, result, _ = first
    over = [Bath("top", c=Ramp((0, 0.125), (10, 0.1)))]
    for changes, said in (
        ({"baths": over}, r"ends at 10 s, but this part starts at 20 s.*start=0.0"),
        ({"start": 0.0}, r"baths keep a history of the clock.*give baths= anew"),
        ({"supports": [Roller("bottom|top", "x")], "loads": []}, r"displaces the body by .* mm near \(0.5\) mm.*support"),
        ({"mesh": scene.mesh}, "no argument 'mesh'"),
    ):
        with pytest.raises(InputError, match=said):
            scene.after(result, **changes)


def test_snapshots_that_mean_something_else(first):
    scene, result, _ = first
    for other, name in (
        (gel(mesh=column(5.0, 8)), "mesh"),
        (gel(model=Potential(3)), "model"),
        (confined_column(cells=8), "model"),
    ):
        with pytest.raises(InputError, match=f"resume: the snapshot has another {name}"):
            other.run(30.0, resume=result.end)
    moved = result.end.values.copy()
    moved[0] = 1e-3  # at the bottom, which is held
    with pytest.raises(InputError, match=r"resume: the snapshot displaces the body by 0.001 mm near \(0\) mm"):
        scene.run(30.0, resume=replace(result.end, values=moved))


def test_an_observer_records_one_run(first):
    for observer in (Ledger(), Probe((0.5,), "J")):
        with pytest.raises(InputError, match="stands here twice"):
            gel().run(2.0, Fixed(2.0), [observer, observer])
        gel().run(2.0, Fixed(2.0), [observer])
        with pytest.raises(InputError, match="make a new one for each run"):
            gel().run(2.0, Fixed(2.0), [observer])
        assert len(observer.time) == 2


def test_one_run_keeps_a_checkpoint_at_a_time(tmp_path):
    (tmp_path / ".run.lock").touch()  # of a process that was killed
    (tmp_path / ".run.0123456789ab.new").touch()
    refused = []

    def second(time, state):
        with pytest.raises(OutputError, match="another run or observer is writing") as caught:
            gel().run(4.0, Fixed(2.0), checkpoint=Checkpoint(tmp_path / "run", overwrite=True))
        refused.append(caught)

    gel().run(4.0, Fixed(2.0), [second], checkpoint=Checkpoint(tmp_path / "run"))
    assert len(refused) == 3
    assert [file.name for file in tmp_path.iterdir()] == ["run"]
    gel().run(4.0, Fixed(2.0), checkpoint=Checkpoint(tmp_path / "run"))


def test_a_series_leaves_its_neighbours_alone(tmp_path):
    scene = strip(cells=(1, 2))
    scene.run(1.0, Fixed(1.0), [VTK(tmp_path / "run_stepped"), VTK(tmp_path / "run")])
    for old in ("run.pvtu", "run_piece1.vtu", "run_step00007_piece0.vtu"):  # of a run on ranks
        (tmp_path / old).touch()
    scene.run(1.0, Fixed(1.0), [VTK(tmp_path / "run", overwrite=True)])
    names = [name + end for name in ("run", "run_stepped") for end in (".pvd", ".vtu", "_step00001.vtu")]
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(names)
    with pytest.raises(OutputError, match="another run or observer is writing"):
        scene.run(1.0, Fixed(1.0), [VTK(tmp_path / "new"), VTK(tmp_path / "new", overwrite=True)])
    for name in ("run_step00001", "run_piece1"):
        with pytest.raises(InputError, match="piece of another series"):
            VTK(tmp_path / name)


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "disk").mkdir()
    link, target = tmp_path / "run", tmp_path / "disk" / "target"
    link.symlink_to(target)
    gel().run(2.0, Fixed(2.0), checkpoint=Checkpoint(link))
    assert link.is_symlink()
    assert read_checkpoint(target).snapshot.time == 2.0
    with replacing(link, "test") as one, replacing(link, "test") as other:
        assert one != other
        one.touch()
        other.touch()


def test_a_parameter_that_changed(first):
    stiffness = Parameter(0.24)
    scene = gel(material=Material(**{**NUMBERS, "mu": stiffness}))
    scene.run(2.0, Fixed(2.0))
    stiffness.Set(0.3)
    with pytest.raises(InputError, match="material's mu has changed since the scene was made"):
        scene.run(2.0, Fixed(2.0))


def test_one_wrong_bit_is_refused_or_changes_nothing(tmp_path):
    gel().run(4.0, Fixed(2.0), [Ledger()], checkpoint=Checkpoint(tmp_path / "run"))
    right, whole = (tmp_path / "run").read_bytes(), read_checkpoint(tmp_path / "run")
    random, refused = np.random.default_rng(0), 0
    for place in random.integers(0, 8 * len(right), 50):
        wrong = bytearray(right)
        wrong[place // 8] ^= 1 << (place % 8)
        (tmp_path / "run").write_bytes(wrong)
        try:
            read = read_checkpoint(tmp_path / "run")
        except InputError:
            refused += 1
            continue
        assert pickle.dumps(read) == pickle.dumps(whole)
    assert refused > 25  # most of the file counts


def end_of(scene):
    ngsolve.SetNumThreads(1)
    return scene.run(4.0, Fixed(2.0)).end.values


def test_scenes_run_in_processes_and_threads():
    uneven = Material(**{**NUMBERS, "mu": 0.24 + 0.01 * ngsolve.x})
    scenes = [gel(), gel(material=uneven), strip(cells=(2, 4)), gel(baths=[Bath("top", c=FALLING, treatment=Penalty(1.0))])]
    assert scenes[0].problem  # what was made of the pieces stays here
    here = [end_of(scene) for scene in scenes]
    with ProcessPoolExecutor(1, get_context("spawn")) as processes, ThreadPoolExecutor(4) as threads:
        for there in (processes.map(end_of, scenes), threads.map(end_of, 3 * scenes)):
            for number, other in enumerate(there):
                np.testing.assert_array_equal(other, here[number % len(here)])
    with pytest.raises(InputError, match="material of the scene cannot be sent"):
        pickle.dumps(gel(material=Material(**NUMBERS, permeability=lambda K, J, nS0: K * J / J)))
