"""What ranks write is what one writes, and what a run of any number of them goes on from."""

import filecmp
import shutil
import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pytest

from ngswell import CSV
from ngswell.streams import Stream
from ngswell.team import Team

FILES = {"probe.csv", "ledger.csv", "log.csv", "checkpoint", "end.npy", "series.pvd"}

FULL = """
import os, resource, sys
from ngswell import CSV, VTK, Fixed, OutputError
from ngswell.team import everyone
from tests.scenes import FALLING, quarter
os.chdir(sys.argv[1])
scene = quarter(None, FALLING, 5, ranks=True)
for rank, most, writes in (0, 200, {"log": "log.csv"}), (1, 2000, {"observers": [VTK("series")]}):
    if everyone().rank == rank:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))
    try:
        scene.run(50.0, Fixed(5.0), unstable="off", **writes)
    except OutputError as error:
        print(everyone().rank, error, flush=True)
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
"""
"""Each rank's files may become no larger than so many bytes, in turn: a disk that is full for one rank."""


@pytest.fixture(scope="module")
def written(together, tmp_path_factory):
    """Folders of runs by one rank and by two, by two of which one was killed, and by two of which one got a signal."""
    folders = {}
    for name, ranks, killed, by in [
        ("one", 1, -1, "SIGKILL"),
        ("two", 2, -1, "SIGKILL"),
        ("killed", 2, 1, "SIGKILL"),
        ("stopped", 2, 1, "SIGTERM"),
    ]:
        folders[name] = tmp_path_factory.mktemp(name)
        ended = run(together, ranks, folders[name], killed, by)
        assert (ended.returncode == 0) == (killed < 0), ended.stderr
        if name == "stopped":
            assert ended.returncode == 143
            assert ended.stderr.count("stopped at t = 25 s; run again with checkpoint=Checkpoint(") == 1
    return folders


def run(together, ranks, folder, killed=-1, by="SIGKILL"):
    return together(ranks, "-m", "tests.ranks.runs", str(folder), str(killed), by, limit=120)


def series(folder):
    """Points and fields of each record, by time; of several pieces one after another, in the order of the points."""
    found = {}
    for entry in ElementTree.parse(folder / "series.pvd").getroot().iter("DataSet"):
        file = folder / entry.get("file")
        pieces = [file]
        if file.suffix == ".pvtu":
            root = ElementTree.parse(file).getroot()
            pieces = [folder / piece.get("Source") for piece in root.iter("Piece")]
            declared = {array.get("Name"): int(array.get("NumberOfComponents")) for array in root.find(".//PPointData")}
        # meshio mistakes offsets of arrays for others where these happen to be alike; those of 5 × 5 cells are not.
        read = [meshio.read(piece) for piece in pieces]
        if file.suffix == ".pvtu":
            assert all(declared == {name: v.shape[1] for name, v in piece.point_data.items()} for piece in read)
        points = np.concatenate([piece.points for piece in read])
        # Points that cells of two ranks have are in both of their pieces.
        _, order = np.unique(points.round(9), axis=0, return_index=True)
        fields = {name: np.concatenate([piece.point_data[name] for piece in read])[order] for name in read[0].point_data}
        cells = sum(len(block.data) for piece in read for block in piece.cells)
        found[float(entry.get("timestep"))] = (points[order], fields, cells)
    return found


def same(one, other):
    """Records, steps, end and series are equal but for round-off: sums over ranks are taken in another order."""
    np.testing.assert_allclose(np.load(one / "end.npy"), np.load(other / "end.npy"), rtol=0, atol=1e-10)
    for table in ("probe.csv", "ledger.csv"):
        here, there = CSV(one / table).read(), CSV(other / table).read()
        assert here.keys() == there.keys()
        for name in here:
            np.testing.assert_allclose(here[name], there[name], rtol=0, atol=1e-10)
    here, there = series(one), series(other)
    assert here.keys() == there.keys()
    for time in here:
        assert here[time][2] == there[time][2]
        np.testing.assert_allclose(here[time][0], there[time][0], rtol=0, atol=1e-12)
        for name in here[time][1]:
            np.testing.assert_allclose(here[time][1][name], there[time][1][name], rtol=0, atol=1e-10, err_msg=name)


def test_two_ranks_write_what_one_writes(written):
    one, two = written["one"], written["two"]
    same(one, two)
    names = {file.name for file in two.iterdir()}
    assert names >= FILES
    assert {name for name in names - FILES if "_piece" not in name} == {"series.pvtu"} | {
        f"series_step{number:05d}.pvtu" for number in range(1, 6)
    }
    assert {f"series_piece{rank}.vtu" for rank in (0, 1)} <= names


@pytest.mark.parametrize(("name", "ranks"), [("killed", 1), ("killed", 2), ("stopped", 3)])
def test_a_run_that_was_ended_goes_on_with_any_number_of_ranks(name, ranks, written, together, tmp_path):
    folder = tmp_path / "again"
    shutil.copytree(written[name], folder)
    ended = run(together, ranks, folder)
    assert ended.returncode == 0, ended.stderr
    same(written["two"], folder)
    if ranks == 2:  # the same numbers of ranks take the same sums
        for table in ("probe.csv", "ledger.csv", "end.npy", "series_step00005_piece1.vtu"):
            assert filecmp.cmp(written["two"] / table, folder / table, shallow=False), table


def test_a_refusal_is_told_once_and_leaves_files_as_they_were(written, together, tmp_path):
    folder = tmp_path / "again"
    shutil.copytree(written["two"], folder)
    code = (
        "from pathlib import Path; from ngswell import *; from tests.scenes import FALLING, quarter\n"
        f"quarter(None, FALLING, 4, ranks=True).run(50.0, Fixed(5.0), checkpoint=Checkpoint({str(folder / 'checkpoint')!r}))"
    )
    ended = together(2, "-c", code, limit=120)
    assert ended.returncode == 1
    assert ended.stderr.count("is of another scene: mesh differ") == 1
    assert filecmp.cmp(written["two"] / "checkpoint", folder / "checkpoint", shallow=False)
    assert {file.name for file in folder.iterdir()} == {file.name for file in written["two"].iterdir()}


def test_a_full_disk_of_one_rank_is_an_error_of_all(together, tmp_path):
    ended = together(2, "-c", FULL, str(tmp_path), limit=120)
    assert ended.returncode == 0, ended.stderr
    for said in ("0 run: log: log.csv", "1 run: log: log.csv", "0 VTK: series_piece1.vtu", "1 VTK: series_piece1.vtu"):
        assert ended.stdout.count(f"{said} could not be written") == 1, ended.stdout
    assert {file.name for file in tmp_path.iterdir()} == {"log.csv", "series_piece0.vtu"}  # no half-written one


def test_a_rank_that_does_not_see_the_file_says_so(tmp_path):
    stream = Stream(CSV(tmp_path / "there.csv"), "Probe")
    stream.begin()
    stream.write(["time [s]"])
    stream.close()
    assert list(stream.there().rows()) == [["time [s]"]]
    other = Team()
    other.rank = 1
    stream._team = other
    assert list(stream.there().rows()) == [["time [s]"]]
    (tmp_path / "there.csv").write_text("time [h]\n")
    with pytest.raises(ValueError, match="rank 1 does not find"):
        stream.there()
