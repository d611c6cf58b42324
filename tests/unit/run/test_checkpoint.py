"""Checkpoints: what a resumed run repeats, what files and scenes are refused, what a failed write leaves."""

import json
import os
from dataclasses import dataclass, replace
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
    Outflow,
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
from ngswell.files import read_tree, write_tree
from ngswell.observers.base import Observer
from ngswell.run.digest import setup_digest
from ngswell.solve.direct import CondensedSolver, LinearSolver
from ngswell.solve.factors import best_solver
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
        Area(), Ledger(), Outflow("top", end), Coarseness(), Snapshots([0.0, 3.0, 15.0, 39.0]), Progress(),
    ]  # fmt: skip


def series(observers):
    """All that was recorded, as one tree of arrays; what the clock says left out."""
    found = {}
    for number, observer in enumerate(observers):
        found[str(number)] = {key: value for key, value in observer.state().items() if key != "seconds"}
        found[f"{number} time"] = observer.time
    return found


def check_equal(one, other, at=""):
    """Two trees of arrays have the same branches and, to the bit, the same entries."""
    assert one.keys() == other.keys(), at
    for key, value in one.items():
        if isinstance(value, dict):
            check_equal(value, other[key], f"{at}/{key}")
        else:
            assert np.asarray(value).dtype == np.asarray(other[key]).dtype, f"{at}/{key}"
            np.testing.assert_array_equal(value, other[key], err_msg=f"{at}/{key}", strict=True)


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

    def run(scene, observers, **more):
        return scene.run(40.0, steps, observers, solver=direct(name), **more)

    checkpoint, before = Checkpoint(tmp_path / "run", every=0.0), watched(1)
    copies = Collect(checkpoint.path)
    through = run(confined_column(cells=8, **changes), [*before, copies], checkpoint=checkpoint)
    assert len(copies.copies) == len(through.steps)  # one from the start on; the last step's own is `checkpoint.path`
    if case == "rejections":
        assert through.rejections
    middle = copies.copies[len(copies.copies) // 2]  # the first has a new scene; then the scene has an unrelated past
    again = confined_column(cells=8, **changes)
    stride = 1 + len(copies.copies) // 12
    for path in [middle, *copies.copies[::stride], checkpoint.path]:
        restart, observers = read_checkpoint(path), watched(1)
        resumed = run(again, observers, resume=restart)
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
    through = run(observers=[copies], checkpoint=checkpoint)
    restart = read_checkpoint(copies.copies[5])
    assert run(resume=restart).end.values.tolist() == through.end.values.tolist()
    assert run(resume=restart.snapshot).end.values.tolist() != through.end.values.tolist()


class Forgetful(Observer):
    """Starts anew in a resumed run: tells from where it goes on."""

    def start(self, problem, begin, until):
        self.begun, self.seen = begin, []

    def observe(self, problem, step):
        self.seen.append(step.time)


class Halt(Observer):
    """Ends a run in its midst, with an error of its own."""

    def observe(self, problem, step):
        if step.time > 15.0:
            raise RuntimeError("halted")


def test_a_script_that_is_run_twice_goes_on_by_itself(tmp_path, one_thread):
    def script(folder, *more, **options):
        folder.mkdir(exist_ok=True)
        observers, scene = watched(1), confined_column(None, c=FALLING, model=Potential(), cells=8)
        checkpoint = Checkpoint(folder / "run", every=0.0, **options)
        return scene.run(40.0, Adaptive(1e-3), [*observers, *more], checkpoint=checkpoint), observers

    def check_same(result, observers):
        assert result.end.time == through.end.time
        np.testing.assert_array_equal(result.end.values, through.end.values)
        assert result.steps == through.steps
        assert (result.factorisations, result.solves) == (through.factorisations, through.solves)
        check_equal(series(observers), series(before))

    through, before = script(tmp_path / "whole")
    halted, file, forgetful = tmp_path / "halted", tmp_path / "halted" / "run", Forgetful()
    with pytest.raises(RuntimeError, match="halted"):
        script(halted, Halt())
    reached = read_checkpoint(file).snapshot.time
    assert 0.0 < reached < through.end.time
    check_same(*script(halted, forgetful))
    assert (forgetful.begun, forgetful.seen) == (reached, [step.time for step in through.steps if step.time > reached])
    finished = file.read_bytes()
    forgetful = Forgetful()
    check_same(*script(halted, forgetful))  # the run is over: nothing is computed
    assert (forgetful.begun, forgetful.seen) == (40.0, [])
    assert file.read_bytes() == finished

    forgetful = Forgetful()
    check_same(*script(halted, forgetful, overwrite=True))
    assert (forgetful.begun, len(forgetful.seen)) == (0.0, len(through.steps))
    with pytest.raises(RuntimeError, match="halted"):
        script(halted, Halt(), overwrite=True)
    assert read_checkpoint(file).snapshot.time == reached  # of the new run, in place of the finished one


def test_with_an_iterative_solver_the_rest_is_the_same_to_its_tolerance(tmp_path, one_thread):
    def run(**more):
        scene = strip(None, c=FALLING, model=Potential(), cells=(1, 6))
        return scene.run(20.0, Adaptive(1e-3), solver=TwoLevelSolver, **more)

    checkpoint = Checkpoint(tmp_path / "run", every=0.0)
    copies = Collect(checkpoint.path)
    through = run(observers=[copies], checkpoint=checkpoint)
    resumed = run(resume=read_checkpoint(copies.copies[3]))
    # What a solve leaves, 1e-3 of a correction, may differ: it starts without the directions that earlier ones have tried.
    # Newton's method goes on to 2e-3 of the tolerance 1e-3; what it leaves is mostly far below.
    assert resumed.end.values == pytest.approx(through.end.values, abs=1e-8)


def files(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir() if "series" in file.name}


def test_a_vtk_series_goes_on_from_an_older_checkpoint(tmp_path, one_thread):
    def run(folder, until=30.0, resume=None, every=0.0, overwrite=False):
        scene = strip(None, c=FALLING, model=Potential(), cells=(1, 4))
        observers, checkpoint = [VTK(folder / "series", "p", overwrite=overwrite)], Checkpoint(folder / "run", every)
        scene.run(until, Fixed(5.0), observers, resume=resume, checkpoint=checkpoint)

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
        def observe(self, problem, step):
            listed = [line.split('"')[3] for line in Path("series.pvd").read_text().splitlines() if "DataSet" in line]
            assert all(Path(name).read_bytes().rstrip().endswith(b"</VTKFile>") for name in listed)
            seen.append(len(listed))

    observers, checkpoint = [VTK(here / "series", "p"), Look()], Checkpoint(here / "run")
    scene = strip(None, c=FALLING, model=Potential(), cells=(1, 4))
    scene.run(30.0, Fixed(5.0), observers, resume=read_checkpoint("run"), checkpoint=checkpoint)
    assert seen == [4, 5, 6, 7]  # pieces beyond the checkpoint are not named until they are written again
    assert files(tmp_path) == through
    (tmp_path / "series_step00001.vtu").unlink()
    with pytest.raises(InputError, match=r"step00001.*missing"):
        run(here, until=40.0, resume=read_checkpoint("run"))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A finished run of a small column in a file."""
    path = tmp_path_factory.mktemp("written") / "run"
    confined_column(cells=4).run(4.0, Fixed(1.0), [Probe((0.5,), "J")], checkpoint=Checkpoint(path))
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
        return setup_digest(confined_column(cells=4, material=material))["material"]

    stiff = ngsolve.x + 0.24
    assert digest(mu=stiff) == digest(mu=0.24 + ngsolve.x)
    assert digest(mu=stiff) != digest(mu=1.0001 * stiff)
    assert digest(permeability=lambda K, J, nS: K * J) != digest(permeability=lambda K, J, nS: K * J * J)
    blend = [ngswell.Blend(Ramp((0, 0.15)), Ramp((0, 0.15), (9, 0.1)), weight) for weight in (2 * ngsolve.x, ngsolve.x)]
    scenes = [confined_column(cells=4, baths=[Bath("top", c=c)], initial=(0.15, 0.0)) for c in blend]
    one, other = (setup_digest(scene) for scene in scenes)
    assert {name for name in one if one[name] != other[name]} == {"baths"}


def solid_law(energy):
    """A solid law of the name Law, whatever its energy."""

    @dataclass(frozen=True)
    class Law:
        def energy(self, deformation, material):
            return energy(deformation, material)

    return Law()


def test_solid_laws_of_one_name_are_told_apart_by_their_stresses():
    def digest(energy):
        return setup_digest(confined_column(cells=4, material=replace(ngswell.TABLE_1, solid=solid_law(energy))))["material"]

    def fibres(*direction):
        """Along `direction`, beside the paper's law; they act where stretched or compressed."""

        def energy(d, m):
            stretched = d.F * ngsolve.CF(direction)
            return paper(d, m) + m.mu * (ngsolve.InnerProduct(stretched, stretched) - 1) ** 2

        return energy

    paper = ngswell.NeoHookean().energy
    energies = [
        paper,
        lambda d, m: 1.0001 * paper(d, m),
        lambda d, m: paper(d, m) + m.mu * (d.I1 - 3 - 2 * ngsolve.log(d.J)) ** 2,  # the same moduli at F = I
        lambda d, m: paper(d, m) + m.mu * (d.J - 1) ** 4,
        *(fibres(*direction) for direction in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.8, 0), (0.6, 0, 0.8)]),
    ]
    digests = [digest(energy) for energy in energies]
    assert len(set(digests)) == len(energies)
    assert [digest(energy) for energy in energies] == digests
    assert digest(lambda d, m: paper(d, m) + 1.0) == digests[0]  # a constant makes no other law


@pytest.mark.parametrize("observers", [[], [Probe((0.4,), "J")], [Probe((0.5,), "J"), Area()], [Area()]])
def test_other_observers_are_refused(written, observers):
    with pytest.raises(InputError, match=r"has the observers Probe\(\(0.5,\), 'J'\), this run .*read_checkpoint"):
        confined_column(cells=4).run(8.0, Fixed(1.0), observers, resume=read_checkpoint(written))


class Remembering(Observer):
    def prepare(self, problem, begin, until):
        self.steps = []

    def observe(self, problem, step):
        self.steps.append(step.dt)

    def state(self):
        return {"steps": np.array(self.steps)}

    def restore(self, state):
        self.steps = state["steps"].tolist()


def test_observers_of_ones_own(tmp_path):
    path, scene = tmp_path / "run", confined_column(cells=4)
    scene.run(2.0, Fixed(1.0), [Forgetful(), Remembering()], checkpoint=Checkpoint(path))
    forgetful, remembering = Forgetful(), Remembering()
    scene.run(4.0, Fixed(1.0), [remembering, forgetful], resume=read_checkpoint(path))
    assert (forgetful.begun, forgetful.seen) == (2.0, [3.0, 4.0])
    assert remembering.steps == [1.0] * 4


def test_resume_beside_a_checkpoint(written, tmp_path):
    def run(until, resume, checkpoint, *more):
        probe = Probe((0.5,), "J")
        return confined_column(cells=4).run(until, Fixed(1.0), [probe, *more], resume=resume, checkpoint=checkpoint), probe

    restart, path = read_checkpoint(written), tmp_path / "run"
    shorter, _ = run(2.0, None, Checkpoint(path))
    before, source = path.read_bytes(), written.read_bytes()
    for resume in (restart, restart.snapshot, shorter.end):
        with pytest.raises(OutputError, match=f"{path} exists.*leave resume out.*overwrite=True"):
            run(8.0, resume, Checkpoint(path))
    assert path.read_bytes() == before

    result, probe = run(6.0, restart, Checkpoint(path, overwrite=True))  # another file's run, with its records
    assert (len(result.steps), probe.time.tolist()) == (6, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    result, probe = run(7.0, read_checkpoint(path), Checkpoint(path))  # its own file may be named too
    assert (len(result.steps), len(probe.time)) == (7, 8)
    result, probe = run(8.0, restart, Checkpoint(tmp_path / "new"))
    assert (len(result.steps), read_checkpoint(tmp_path / "new").snapshot.time) == (8, 8.0)
    result, probe = run(6.0, restart.snapshot, Checkpoint(tmp_path / "anew"))  # the state alone
    assert (len(result.steps), probe.time.tolist()) == (2, [4.0, 5.0, 6.0])
    assert written.read_bytes() == source


def test_trees_come_back_from_a_file_as_they_were(tmp_path):
    path, header = tmp_path / "tree", {"format": 7, "words": ["a/b", "ä"], "nothing": None, "number": 0.1}
    tree = {
        "numbers": np.linspace(0, 1, 7) / 3,
        "special": np.array([np.inf, -np.inf, np.nan, -0.0, 5e-324]),
        "one": np.array(0.1),
        "whole": np.array([[1, 2], [3, 4]]),
        "flag": np.array(True),
        "words": np.array(["p", "c_plus", ""]),
        "no entries": np.zeros((0, 3)),
        "empty": {},
        "levels": {"one": {"two": {"three": np.arange(3.0)}, "empty": {}}, "empty": {"empty": {}}, "0": np.arange(2)},
        "left|right": {"a/b": {"c/d": np.arange(4.0), "/": {}}, "a": {"b": np.arange(5.0)}, "%2F": np.arange(6), "a%": {}},
        "%252F/": {"top bottom": np.arange(3), "ü": np.arange(1)},
    }
    write_tree(path, "Test", header, tree)
    said, found = read_tree(path)
    assert {name: said[name] for name in header} == header
    check_equal(found, tree)
    assert list(found) == list(tree)  # observers and steps are told by their order

    write_tree(path, "Test", {}, {})
    assert read_tree(path)[1] == {}
    write_tree(path, "Test", {}, {"numbers": [1.5, 2.5], "number": 3.5})  # what numpy makes arrays of
    check_equal(read_tree(path)[1], {"numbers": np.array([1.5, 2.5]), "number": np.array(3.5)})
    assert [file.name for file in tmp_path.iterdir()] == ["tree"]


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
            assert (restart.snapshot.time, restart.steps, restart.digest) == (same.snapshot.time, same.steps, same.digest)
            check_equal(restart.stepper, same.stepper)
            check_equal(restart.observers[0][1], same.observers[0][1])
    assert found > 200  # most of the file is data


def test_other_versions(written, tmp_path, monkeypatch):
    restart = read_checkpoint(written)
    with np.load(written) as archive:
        arrays = dict(archive)
    said = json.loads(arrays["header"].item())
    assert said["format"] == 4
    for other in (3, 5):
        arrays["header"] = np.array(json.dumps({**said, "format": other, "fields": "elsewhere"}).encode())
        np.savez(tmp_path / "other.npz", **arrays)
        with pytest.raises(InputError, match=rf"checkpoint format {other}.*reads 4; go on with the version that wrote it"):
            read_checkpoint(tmp_path / "other.npz")
    monkeypatch.setattr("ngswell.run.restart.__version__", "0.0.9")
    with pytest.raises(InputError, match=rf"written by {restart.versions}.*this is ngswell 0.0.9"):
        confined_column(cells=4).run(8.0, Fixed(1.0), [Probe((0.5,), "J")], resume=restart)


def test_what_cannot_be_written_is_refused_before_computing(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    scene = confined_column(cells=4)
    advanced = []
    monkeypatch.setattr("ngswell.run.run.Stepper", lambda *a: advanced.append(a))
    for path, words in (
        (tmp_path / "none" / "run", "no folder"),
        (tmp_path / "file" / "run", "no folder"),
        (tmp_path, "is a folder"),
    ):
        with pytest.raises(OutputError, match=words):
            scene.run(4.0, Fixed(1.0), checkpoint=Checkpoint(path))
    with pytest.raises(InputError, match=r"no checkpoint.*overwrite=True"):
        scene.run(4.0, Fixed(1.0), checkpoint=Checkpoint(tmp_path / "file"))
    with pytest.raises(OutputError, match="is a folder"):
        scene.run(4.0, Fixed(1.0), checkpoint=Checkpoint(tmp_path, overwrite=True))
    monkeypatch.setattr("os.access", lambda *a: False)
    with pytest.raises(OutputError, match="cannot be written to"):
        scene.run(4.0, Fixed(1.0), checkpoint=Checkpoint(tmp_path / "run"))
    with pytest.raises(InputError, match="every"):
        Checkpoint(tmp_path / "run", every=-1.0)
    with pytest.raises(InputError, match="checkpoint"):
        scene.run(4.0, Fixed(1.0), checkpoint=tmp_path / "run")
    with pytest.raises(InputError, match=r"observers.*Checkpoint"):
        scene.run(4.0, Fixed(1.0), [Checkpoint(tmp_path / "run")])  # where it stood before
    assert not advanced
    assert (tmp_path / "file").read_text() == "not a folder"


def test_a_failed_write_stops_the_run_and_leaves_the_file_before(tmp_path, monkeypatch):
    path, scene, probe = tmp_path / "run", confined_column(c=FALLING, cells=4), Probe((0.5,), "J")
    kept = []

    class Fill(Observer):
        def observe(self, problem, step):
            if step.time == 3.0:
                kept.extend([path.read_bytes(), problem])
                monkeypatch.setattr("os.fsync", full)

    def full(file):
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match=f"{path}.*No space left on device.*unchanged.*Free space"):
        scene.run(9.0, Fixed(1.0), [probe, Fill()], checkpoint=Checkpoint(path, every=0.0))
    assert [file.name for file in tmp_path.iterdir()] == ["run"]
    before, problem = kept
    assert path.read_bytes() == before
    assert read_checkpoint(path).snapshot.time == 2.0
    assert problem.time == 3.0  # the last accepted state
    assert probe.values["J"][-1] == problem.state.J(scene.mesh(0.5))


def test_a_vtk_piece_that_is_cut_short_is_noticed(tmp_path, monkeypatch):
    class Writer:
        def __init__(self, mesh, coefs, names, filename, subdivision):
            self.filename = filename

        def Do(self, drawelems):
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
        def observe(self, problem, step):
            if not written or written[-1] != read_checkpoint(path).snapshot.time:
                written.append(read_checkpoint(path).snapshot.time)
            if step.time == 6.0:
                checkpoint.request()

    for checkpoint, times in (
        (Checkpoint(tmp_path / "hourly", every=3600.0), [0.0]),
        (Checkpoint(tmp_path / "each", every=0.0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
        (Checkpoint(tmp_path / "at", when=[2.5, 4.0]), [0.0, 2.5, 4.0]),
    ):
        path, written = checkpoint.path, []
        confined_column(cells=4).run(10.0, Fixed(1.0), [Times()], checkpoint=checkpoint)
        assert [time for time in written if time < 6.0] == [time for time in times if time < 6.0]
        assert (6.0 in written) or times == [0.0, 2.5, 4.0]  # asked for after the step to 6 s
        assert read_checkpoint(path).snapshot.time == 10.0


def test_a_run_that_fails_leaves_its_last_accepted_state(tmp_path):
    outrunning = Ramp((0, 1.0), (10, 1.0), (12, 20.0))  # the charge uses up all ions

    def run(steps=None, **more):
        scene = confined_column(None, c=0.15, charge=outrunning, model=Potential(), cells=8)
        return scene.run(40.0, steps or Adaptive(0.1), **more)

    checkpoint, probe = Checkpoint(tmp_path / "run", every=3600.0), Probe((0.5,), "J")
    with pytest.raises(StepError) as failed:
        run(observers=[probe], checkpoint=checkpoint)
    restart = read_checkpoint(checkpoint.path)
    assert restart.snapshot.time == failed.value.end.time == failed.value.time == probe.time[-1]
    assert restart.snapshot.values.tolist() == failed.value.end.values.tolist()
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
        probe = Probe((0.5,), "J")
        return confined_column(cells=4).run(until, Fixed(1.0), [probe], checkpoint=Checkpoint(path)), probe

    stamp = path.stat().st_mtime_ns
    result, probe = run(4.0)
    assert (len(result.steps), result.end.time, probe.time.tolist()) == (4, 4.0, [0.0, 1.0, 2.0, 3.0, 4.0])
    assert path.stat().st_mtime_ns == stamp
    result, probe = run(6.0)
    assert (len(result.steps), result.end.time, len(probe.time)) == (6, 6.0, 7)
    with pytest.raises(InputError, match="before the checkpoint, 6 s"):
        run(5.0)
    assert Checkpoint(tmp_path / "none").read() is None
