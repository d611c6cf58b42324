"""Checkpoints: what a resumed run repeats, what files and scenes are refused, what a failed write leaves."""

import json
import os
from dataclasses import replace
from pathlib import Path

import ngsolve
import numpy as np
import pytest

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
from ngswell.observers.base import Observer
from ngswell.solve.direct import CondensedSolver, LinearSolver, best_solver
from tests.scenes import FALLING, confined_column, strip


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
    "potential": ({"treatment": None, "model": Potential(), "c": FALLING}, Adaptive(1e-3)),
    "potential, tight": ({"treatment": None, "model": Potential(3), "c": FALLING}, Adaptive(1e-4)),
    "rejections": ({"treatment": None, "model": Concentration(), "c": SUDDEN}, Adaptive(1e-4)),
    "concentration": ({"model": Concentration(), "c": FALLING}, Adaptive(1e-3)),
    "multiplier": ({"treatment": Multiplier(), "model": Concentration(), "c": FALLING}, Adaptive(1e-3)),
    "backward Euler": ({"treatment": None, "model": Potential(), "c": SUDDEN}, Adaptive(1e-2, scheme=BACKWARD_EULER)),
    "fixed steps": ({"model": Concentration(), "c": FALLING}, Fixed(4.0)),
    "lagged": ({"treatment": Lagged(), "model": Concentration(), "c": FALLING}, Fixed(4.0)),
    "frozen": ({"treatment": Frozen(), "model": Concentration(), "c": FALLING}, Adaptive(1e-2, scheme=BACKWARD_EULER)),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted({"umfpack", best_solver()}))
@pytest.mark.parametrize("case", CASES)
def test_a_run_resumed_after_a_step_is_the_same_to_the_bit(case, name, tmp_path, one_thread):
    changes, steps = CASES[case]

    def run(scene, observers, resume=None):
        return scene.run(40.0, steps, observers, resume=resume, solver=direct(name))

    checkpoint, before = Checkpoint(tmp_path / "run", every=0.0), watched(1)
    copies = Collect(checkpoint.path)
    through = run(confined_column(cells=8, **changes), [*before, copies, checkpoint])
    assert len(copies.copies) == len(through.steps)  # one from the start on; the last step's own is `checkpoint.path`
    if case == "rejections":
        assert through.rejections
    middle = copies.copies[len(copies.copies) // 2]  # the first has a new scene; then the scene has an unrelated past
    again = confined_column(cells=8, **changes)
    stride = 1 + len(copies.copies) // 12
    for path in [middle, *copies.copies[::stride], checkpoint.path]:
        restart, observers = read_checkpoint(path), watched(1)
        resumed = run(again, observers, restart)
        assert resumed.end.time == through.end.time
        np.testing.assert_array_equal(resumed.end.values, through.end.values)
        assert resumed.steps == through.steps
        # The analysis and the kept matrix are made again: they do not count twice.
        assert (resumed.factorisations, resumed.solves) == (through.factorisations, through.solves)
        check_equal(series(observers), series(before))


def test_from_its_state_alone_a_run_goes_on_within_newtons_tolerance_only(tmp_path, one_thread):
    # The control of the test above: a stepper that starts anew takes other steps.
    def run(**more):
        return confined_column(None, c=FALLING, model=Potential(), cells=8).run(40.0, Adaptive(1e-3), **more)

    checkpoint = Checkpoint(tmp_path / "run", every=0.0)
    copies = Collect(checkpoint.path)
    through = run(observers=[copies, checkpoint])
    restart = read_checkpoint(copies.copies[5])
    assert run(resume=restart).end.values.tolist() == through.end.values.tolist()
    assert run(resume=restart.snapshot).end.values.tolist() != through.end.values.tolist()


def test_with_an_iterative_solver_the_rest_is_the_same_to_its_tolerance(tmp_path, one_thread):
    def run(**more):
        scene = strip(None, c=FALLING, model=Potential(), cells=(1, 6))
        return scene.run(20.0, Adaptive(1e-3), solver=TwoLevelSolver, **more)

    checkpoint = Checkpoint(tmp_path / "run", every=0.0)
    copies = Collect(checkpoint.path)
    through = run(observers=[copies, checkpoint])
    resumed = run(resume=read_checkpoint(copies.copies[3]))
    # What GMRES leaves, 1e-8 of a correction, may differ: it starts on the other coarse level. Corrections are below 1.
    assert resumed.end.values == pytest.approx(through.end.values, abs=1e-8)


def files(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir() if "series" in file.name}


def test_a_vtk_series_goes_on_from_an_older_checkpoint(tmp_path, one_thread):
    def run(folder, until=30.0, resume=None, every=0.0, overwrite=False):
        observers = [VTK(folder / "series", "p", overwrite=overwrite), Checkpoint(folder / "run", every)]
        strip(None, c=FALLING, model=Potential(), cells=(1, 4)).run(until, Fixed(5.0), observers, resume=resume)

    os.chdir(tmp_path)  # observers are told apart by the path they were given
    here = Path(".")
    run(here, until=10.0)
    older = (tmp_path / "run").read_bytes()
    run(here, resume=read_checkpoint("run"))
    through = files(tmp_path)
    assert len(through) == 8  # of 0, 5, …, 30 s, and the .pvd

    (tmp_path / "run").write_bytes(older)
    (tmp_path / "series_step00006.vtu").write_bytes(b"half a piece")  # as a kill while NGSolve writes
    seen = []

    class Look(Observer):
        def observe(self, problem, report):
            listed = [line.split('"')[3] for line in Path("series.pvd").read_text().splitlines() if "DataSet" in line]
            assert all(Path(name).read_bytes().rstrip().endswith(b"</VTKFile>") for name in listed)
            seen.append(len(listed))

    observers = [VTK(here / "series", "p"), Look(), Checkpoint(here / "run")]
    scene = strip(None, c=FALLING, model=Potential(), cells=(1, 4))
    scene.run(30.0, Fixed(5.0), observers, resume=read_checkpoint("run"))
    assert seen == [4, 5, 6, 7]  # pieces beyond the checkpoint are not named until they are written again
    assert files(tmp_path) == through
    (tmp_path / "series_step00001.vtu").unlink()
    with pytest.raises(InputError, match=r"step00001.*missing"):
        run(here, until=40.0, resume=read_checkpoint("run"))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A finished run of a small column in a file."""
    path = tmp_path_factory.mktemp("written") / "run"
    confined_column(cells=4).run(4.0, Fixed(1.0), [Probe((0.5,), "J"), Checkpoint(path)])
    return path


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"cells": 5}, "mesh"),
        ({"material": replace(ngswell.TABLE_1, mu=0.25)}, "material"),
        ({"material": replace(ngswell.TABLE_1, mu=ngsolve.x + 0.24)}, "material"),
        ({"material": replace(ngswell.TABLE_1, permeability=lambda K, J, nS: K * J)}, "material"),
        ({"model": Concentration(order=3)}, "model"),
        ({"c": 0.14, "initial": (0.15, 0.0)}, "initial, baths"),
        ({"treatment": ngswell.Penalty(2.0)}, "baths"),
        ({"loads": [ngswell.Traction("top", (-0.1,))]}, "loads"),
        ({"charge": Ramp((0, 1.0), (10, 1.1))}, "charge"),
        ({"supports": [ngswell.Pin((0.0,), "x")]}, "supports"),
        ({"start": 1.0}, "start"),
    ],
)
def test_another_scene_is_named_by_the_part_that_differs(written, changes, part):
    scene = confined_column(**{"cells": 4, **changes})
    with pytest.raises(InputError, match=f"another scene: {part} differ"):
        scene.run(8.0, Fixed(1.0), [Probe((0.5,), "J")], resume=read_checkpoint(written))


def test_fields_of_position_and_laws_count_by_their_values():
    def digest(**changes):
        material = replace(ngswell.TABLE_1, **changes)
        return ngswell.run.restart.parts(confined_column(cells=4, material=material))["material"]

    stiff = ngsolve.x + 0.24
    assert digest(mu=stiff) == digest(mu=0.24 + ngsolve.x)
    assert digest(mu=stiff) != digest(mu=1.0001 * stiff)
    assert digest(permeability=lambda K, J, nS: K * J) != digest(permeability=lambda K, J, nS: K * J * J)
    blend = [ngswell.Blend(Ramp((0, 0.15)), Ramp((0, 0.15), (9, 0.1)), weight) for weight in (2 * ngsolve.x, ngsolve.x)]
    scenes = [confined_column(cells=4, baths=[Bath("top", c=c)], initial=(0.15, 0.0)) for c in blend]
    one, other = (ngswell.run.restart.parts(scene) for scene in scenes)
    assert {name for name in one if one[name] != other[name]} == {"baths"}


@pytest.mark.parametrize("observers", [[], [Probe((0.4,), "J")], [Probe((0.5,), "J"), Area()], [Area()]])
def test_other_observers_are_refused(written, observers):
    with pytest.raises(InputError, match=r"has the observers Probe\(\(0.5,\), 'J'\), this run .*restart.snapshot"):
        confined_column(cells=4).run(8.0, Fixed(1.0), observers, resume=read_checkpoint(written))


class Forgetful(Observer):
    def start(self, problem, begin, until):
        self.begun, self.seen = begin, []

    def observe(self, problem, report):
        self.seen.append(report.time)


class Remembering(Observer):
    def prepare(self, problem, begin, until):
        self.steps = []

    def observe(self, problem, report):
        self.steps.append(report.dt)

    def memory(self):
        return {"steps": np.array(self.steps)}

    def remember(self, memory):
        self.steps = memory["steps"].tolist()


def test_observers_of_ones_own(tmp_path):
    path, scene = tmp_path / "run", confined_column(cells=4)
    scene.run(2.0, Fixed(1.0), [Forgetful(), Remembering(), Checkpoint(path)])
    forgetful, remembering = Forgetful(), Remembering()
    scene.run(4.0, Fixed(1.0), [remembering, forgetful], resume=read_checkpoint(path))
    assert (forgetful.begun, forgetful.seen) == (2.0, [3.0, 4.0])
    assert remembering.steps == [1.0] * 4


def test_damaged_and_foreign_files(written, tmp_path):
    whole, path = written.read_bytes(), tmp_path / "other"

    def refused(content, words="no checkpoint, or is cut short or damaged"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=words):
            read_checkpoint(path)

    for length in [0, 1, 100, len(whole) // 2, len(whole) - 1]:
        refused(whole[:length])
    refused(b"not a checkpoint")
    refused(os.urandom(1000))
    np.savez(path, ngswel=np.zeros(3))
    refused(path.with_suffix(".npz").read_bytes())
    np.savez(path, ngswell=np.array([{}], dtype=object), fields=np.zeros(3))
    refused(path.with_suffix(".npz").read_bytes())  # a pickle is not loaded
    with pytest.raises(InputError, match="no such file"):
        read_checkpoint(tmp_path / "none")
    with pytest.raises(InputError, match="no such file"):
        read_checkpoint(tmp_path)

    # A bit that falls over is found, or lies where the archive keeps dates and the like.
    same, random = read_checkpoint(written), np.random.default_rng(1)
    found = 0
    for place in random.integers(len(whole), size=300):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        try:
            restart = read_checkpoint(path)
        except InputError:
            found += 1
        else:
            assert restart.snapshot.values.tolist() == same.snapshot.values.tolist()
            assert (restart.snapshot.time, restart.steps, restart.parts) == (same.snapshot.time, same.steps, same.parts)
            check_equal(restart.stepper, same.stepper)
            check_equal(restart.observers[0][1], same.observers[0][1])
    assert found > 200  # most of the file is data


def test_other_versions(written, tmp_path, monkeypatch):
    restart = read_checkpoint(written)
    with np.load(written) as archive:
        arrays = dict(archive)
    said = json.loads(arrays["ngswell"].item())
    arrays["ngswell"] = np.array(json.dumps({**said, "format": 2, "fields": "elsewhere"}).encode())
    np.savez(tmp_path / "later.npz", **arrays)
    with pytest.raises(InputError, match=r"checkpoint format 2.*reads format 1"):
        read_checkpoint(tmp_path / "later.npz")
    monkeypatch.setattr(ngswell, "__version__", "0.0.9")
    with pytest.raises(InputError, match=rf"written by {restart.versions}.*this is ngswell 0.0.9"):
        confined_column(cells=4).run(8.0, Fixed(1.0), [Probe((0.5,), "J")], resume=restart)


def test_what_cannot_be_written_is_refused_before_computing(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    scene = confined_column(cells=4)
    advanced = []
    monkeypatch.setattr("ngswell.scene.Stepper", lambda *a: advanced.append(a))
    for path, words in (
        (tmp_path / "none" / "run", "no folder"),
        (tmp_path / "file" / "run", "no folder"),
        (tmp_path / "file", "exists.*overwrite=True"),
        (tmp_path, "exists"),
    ):
        with pytest.raises(OutputError, match=words):
            scene.run(4.0, Fixed(1.0), [Checkpoint(path)])
    with pytest.raises(OutputError, match="is a folder"):
        scene.run(4.0, Fixed(1.0), [Checkpoint(tmp_path, overwrite=True)])
    monkeypatch.setattr("os.access", lambda *a: False)
    with pytest.raises(OutputError, match="cannot be written to"):
        scene.run(4.0, Fixed(1.0), [Checkpoint(tmp_path / "run")])
    with pytest.raises(InputError, match="every"):
        Checkpoint(tmp_path / "run", every=-1.0)
    assert not advanced
    assert (tmp_path / "file").read_text() == "not a folder"


def test_a_failed_write_stops_the_run_and_leaves_the_file_before(tmp_path, monkeypatch):
    path, scene, probe = tmp_path / "run", confined_column(c=FALLING, cells=4), Probe((0.5,), "J")
    kept = []

    class Fill(Observer):
        def observe(self, problem, report):
            if report.time == 3.0:
                kept.append(path.read_bytes())
                monkeypatch.setattr("os.fsync", full)

    def full(file):
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match=f"{path}.*No space left on device.*unchanged.*Free space"):
        scene.run(9.0, Fixed(1.0), [probe, Fill(), Checkpoint(path, every=0.0)])
    assert [file.name for file in tmp_path.iterdir()] == ["run"]
    assert path.read_bytes() == kept[0]
    assert read_checkpoint(path).snapshot.time == 2.0
    assert scene.problem.time == 3.0  # the last accepted state
    assert probe.values["J"][-1] == scene.problem.state.J(scene.mesh(0.5))


def test_a_vtk_piece_that_is_cut_short_is_noticed(tmp_path, monkeypatch):
    class Writer:
        def __init__(self, mesh, coefs, names, filename, subdivision):
            self.filename = filename

        def Do(self):
            Path(self.filename + ".vtu").write_bytes(b"<VTKFile> half")

    scene = strip(cells=(1, 2))
    scene.run(2.0, Fixed(1.0), [VTK(tmp_path / "series", "p")])
    before = files(tmp_path)
    monkeypatch.setattr("ngswell.observers.vtk.VTKOutput", Writer)
    with pytest.raises(OutputError, match=r"other.vtu could not be written \(it is cut short; is the disk full\?\)"):
        scene.run(2.0, Fixed(1.0), [VTK(tmp_path / "other", "p")])
    assert files(tmp_path) == before
    assert len(list(tmp_path.iterdir())) == len(before)


def test_when_it_is_written(tmp_path):
    class Times(Observer):
        def observe(self, problem, report):
            if not written or written[-1] != read_checkpoint(path).snapshot.time:
                written.append(read_checkpoint(path).snapshot.time)
            if report.time == 6.0:
                checkpoint.request()

    for checkpoint, times in (
        (Checkpoint(tmp_path / "hourly", every=3600.0), [0.0]),
        (Checkpoint(tmp_path / "each", every=0.0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
        (Checkpoint(tmp_path / "at", when=[2.5, 4.0]), [0.0, 2.5, 4.0]),
    ):
        path, written = checkpoint.path, []
        confined_column(cells=4).run(10.0, Fixed(1.0), [Times(), checkpoint])
        assert [time for time in written if time < 6.0] == [time for time in times if time < 6.0]
        assert (6.0 in written) or checkpoint.when  # asked for after the step to 6 s
        assert read_checkpoint(path).snapshot.time == 10.0


def test_a_run_that_fails_leaves_its_last_accepted_state(tmp_path):
    crushing = Ramp((0, 0.15), (10, 0.15), (10.01, 2.0))

    def run(steps=None, **more):
        scene = confined_column(None, c=crushing, model=Potential(), cells=8)
        return scene.run(40.0, steps or Adaptive(0.1), **more)

    checkpoint, probe = Checkpoint(tmp_path / "run", every=3600.0), Probe((0.5,), "J")
    with pytest.raises(StepError) as failed:
        run(observers=[probe, checkpoint])
    restart = read_checkpoint(checkpoint.path)
    assert restart.snapshot.time == failed.value.time == probe.time[-1]
    with pytest.raises(StepError) as again:
        run(observers=[Probe((0.5,), "J")], resume=restart)
    assert again.value.time == failed.value.time


def test_other_steps_go_on_with_the_records(written):
    probe, restart = Probe((0.5,), "J"), read_checkpoint(written)
    result = confined_column(cells=4).run(10.0, Fixed(3.0), [probe], resume=restart)
    assert [step.time for step in result.steps] == probe.time.tolist()[1:] == [1.0, 2.0, 3.0, 4.0, 7.0, 10.0]


def test_a_finished_run_is_over_and_a_later_end_goes_on(written, tmp_path):
    path = tmp_path / "run"
    path.write_bytes(written.read_bytes())

    def run(until):
        checkpoint, probe = Checkpoint(path), Probe((0.5,), "J")
        return confined_column(cells=4).run(until, Fixed(1.0), [checkpoint, probe], resume=checkpoint.read()), probe

    stamp = path.stat().st_mtime_ns
    result, probe = run(4.0)
    assert (len(result.steps), result.end.time, probe.time.tolist()) == (4, 4.0, [0.0, 1.0, 2.0, 3.0, 4.0])
    assert path.stat().st_mtime_ns == stamp
    result, probe = run(6.0)
    assert (len(result.steps), result.end.time, len(probe.time)) == (6, 6.0, 7)
    with pytest.raises(InputError, match="before the checkpoint, 6 s"):
        run(5.0)
    assert Checkpoint(tmp_path / "none").read() is None
