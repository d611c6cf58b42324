"""Runs that are really killed, interrupted, or out of disk space, and go on as if nothing had been.

`NGSWELL_KILLS=200 python -m pytest tests/verification/test_survival.py -k killed` kills that often instead of 12 times.
"""

import ctypes
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from ngswell import OutputError, read_checkpoint
from studies.output import Findings, prepare, write

KILLS = int(os.environ.get("NGSWELL_KILLS", "12"))

SCRIPT = """
import sys
import ngsolve
ngsolve.SetNumThreads(1)  # with more threads two runs differ in the last digits, interrupted or not
import numpy as np
from tests.scenes import strip
from ngswell import *
from ngswell.observers.base import Observer

class Ballast(Observer):
    "Makes a checkpoint large, so that kills hit its writing."
    def state(self): return {"zeros": np.zeros(int(sys.argv[2]))}

class Say(Observer):
    "The run has begun."
    def start(self, problem, begin, until): print(f"from {begin:g} s", flush=True)

scene = strip(None, c=Ramp((0, 0.15), (10, 0.125)), model=Potential(), cells=(1, 8))
checkpoint = Checkpoint("run", every=float(sys.argv[1]))
top, ledger, half = Probe((0.0, 0.5), "displacement", "p", "c_plus"), Ledger(), Area(when=7.5)
files = {}
if sys.argv[4] == "files":
    top, ledger, half = (
        Probe((0.0, 0.5), "displacement", "p", "c_plus", to=CSV("top.csv", overwrite=True)),
        Ledger(to=CSV("ledger.csv", overwrite=True)), Area(when=7.5, to=CSV("area.csv", overwrite=True)),
    )
    files = {"log": CSV("steps.csv", overwrite=True)}
watched = [top, ledger, half, Ballast(), VTK("series", "p", overwrite=True), Say()]
result = scene.run(60.0, Adaptive(float(sys.argv[3])), watched, checkpoint=checkpoint, **files)
np.savez("final", end=result.end.values, steps=[step.dt for step in result.steps], half=half.values, fluid=ledger.fluid,
         left=ledger.fluid_left["top"], time=top.time, **top.values)
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    path = tmp_path_factory.mktemp("script") / "script.py"
    path.write_text(SCRIPT)
    return path


def start(script, folder, every=0.0, ballast=0, tolerance=1e-4, keep="memory", **options):
    return subprocess.Popen(
        [sys.executable, str(script), str(every), str(ballast), str(tolerance), keep],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options,
    )  # fmt: skip


def results(folder):
    """Every file but the checkpoint, which says how long the run took."""
    with np.load(folder / "final.npz") as archive:
        numbers = {name: archive[name].tobytes() for name in archive.files}
    names = {file.name for file in folder.iterdir()}
    written = {name: (folder / name).read_bytes() for name in names if name.startswith("series") or name.endswith(".csv")}
    return numbers, names, written


@pytest.mark.parametrize(("ballast", "keep"), [(0, "files"), (2_000_000, "memory")])
def test_a_run_that_is_killed_again_and_again_ends_with_the_same_numbers(ballast, keep, script, tmp_path):
    """All that writes: VTK series, checkpoints, and files of records and steps."""
    whole = tmp_path / "whole"
    whole.mkdir()
    run = start(script, whole, ballast=ballast, keep=keep)
    run.stdout.readline()
    begun = time.perf_counter()
    assert run.wait() == 0, run.stderr.read()
    seconds = time.perf_counter() - begun
    wanted = results(whole)

    random, kills, seed, inside = np.random.default_rng(ballast), 0, 0, 0
    while kills < KILLS // 2:
        seed += 1
        folder = tmp_path / str(seed)
        folder.mkdir()
        while True:
            run = start(script, folder, ballast=ballast, keep=keep)
            if random.random() < 0.9:  # else while it is loading
                run.stdout.readline()
            try:
                run.wait(random.uniform(0.0, 0.4 * seconds))
            except subprocess.TimeoutExpired:
                run.send_signal(signal.SIGKILL)
                run.wait()
                kills += 1
                inside += any(file.name.startswith(".run.") and ".new" in file.name for file in folder.iterdir())
                if (folder / "run").exists():
                    read_checkpoint(folder / "run")  # whole, whenever it was killed
                if (folder / "series.pvd").exists():
                    listed = [
                        line.split('"')[3] for line in (folder / "series.pvd").read_text().splitlines() if "file=" in line
                    ]
                    assert all((folder / name).read_bytes().rstrip().endswith(b"</VTKFile>") for name in listed)
            if run.returncode != -signal.SIGKILL:
                break
        assert run.returncode == 0, run.stderr.read()
        assert results(folder) == wanted
    print(f"{kills} kills, {inside} of them while a checkpoint was being written, {seed} runs")


def test_ctrl_c_lets_the_step_finish_and_says_how_to_go_on(script, tmp_path):
    for number, status, said in (
        (signal.SIGINT, -signal.SIGINT, "KeyboardInterrupt: stopped at t = "),  # what Python makes of KeyboardInterrupt
        (signal.SIGTERM, 143, "stopped at t = "),
    ):
        folder = tmp_path / number.name
        folder.mkdir()
        run = start(script, folder, every=3600.0, tolerance=1e-7)
        run.stdout.readline()
        time.sleep(0.3)
        run.send_signal(number)
        _, errors = run.communicate(timeout=60)
        assert run.returncode == status, errors
        reached = read_checkpoint(folder / "run").snapshot.time
        assert 0.0 < reached < 60.0
        remedy = f"{reached:.10g} s; run again with checkpoint=Checkpoint('run')"
        assert errors.rstrip().splitlines()[-1].startswith(said + remedy)


HANGING = (
    SCRIPT[: SCRIPT.index("result = ")]
    + """
import signal, time
from ngswell.stepping.stepper import Stepper

stepper = None

def linearise(*arguments, found=ngsolve.BilinearForm.AssembleLinearization):
    if stepper is not None and stepper.accepted.time > 1.0:
        print("in a step", flush=True)
        time.sleep(3600)
    return found(*arguments)

def advance(running, *arguments, found=Stepper._advance):
    global stepper, accepted
    stepper, accepted = running, running.problem.snapshot(running.problem.time)
    return found(running, *arguments)

ngsolve.BilinearForm.AssembleLinearization, Stepper._advance = linearise, advance
try:
    if checkpoint.every:
        scene.run(60.0, Adaptive(1e-4), watched, checkpoint=checkpoint)
    else:
        scene.run(60.0, Adaptive(1e-4), watched[:1])
except KeyboardInterrupt as error:
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert accepted.time == stepper.problem.time == top.time[-1] > 0.0
    assert (accepted.values == stepper.problem.vector).all()
    if checkpoint.every:
        assert checkpoint.read().snapshot.time == accepted.time
    print("accepted", error, flush=True)
"""
)


def test_a_second_ctrl_c_gives_the_step_up(tmp_path):
    path = tmp_path / "hanging.py"
    path.write_text(HANGING)
    run = start(path, tmp_path, every=3600.0)
    assert [run.stdout.readline() for _ in range(2)] == ["from 0 s\n", "in a step\n"]
    run.send_signal(signal.SIGINT)
    time.sleep(0.5)
    assert run.poll() is None  # the first one waits for the step
    run.send_signal(signal.SIGINT)
    said, errors = run.communicate(timeout=60)
    assert said.startswith("accepted stopped at t = "), errors


def test_ctrl_c_without_a_checkpoint_leaves_the_last_accepted_state(tmp_path):
    path = tmp_path / "hanging.py"
    path.write_text(HANGING)
    run = start(path, tmp_path)  # every=0 stands for none
    assert run.stdout.readline() == "in a step\n"
    run.send_signal(signal.SIGINT)
    said, errors = run.communicate(timeout=60)
    assert said.startswith("accepted"), errors


def test_a_signal_that_is_ignored_stays_ignored(script, tmp_path):
    run = start(script, tmp_path, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    run.stdout.readline()
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=120)
    assert run.returncode == 0, errors


# -- full and read-only disks ----------------------------------------------------------------------------------------------

libc = ctypes.CDLL(None, use_errno=True)
READ_ONLY, REMOUNT, DETACH = 1, 32, 2  # of <sys/mount.h>


def mount(folder, options, flags=0):
    return libc.mount(b"tmpfs", str(folder).encode(), b"tmpfs", flags, options.encode()) == 0


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 256 kB, and a way to make it read-only; a mount needs the right to."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if not mount(folder, "size=256k"):
        pytest.skip("no right to mount a small file system")
    yield folder
    libc.umount2(str(folder).encode(), DETACH)


def check_what_is_left(folder, errors, said):
    """The run ended with OutputError, its file of before is whole, nothing half-written lies about."""
    assert errors.rstrip().splitlines()[-1].startswith(said), errors
    assert not [file.name for file in folder.iterdir() if file.name.startswith(".")]
    for piece in folder.glob("series*.vtu"):
        assert piece.read_bytes().rstrip().endswith(b"</VTKFile>")
    return read_checkpoint(folder / "run")


@pytest.mark.parametrize(
    ("size", "every", "what"), [(76, 0.0, "Checkpoint: run"), (108, 0.0, "Checkpoint: run"), (76, 3600.0, "VTK: series")]
)  # kB, s: the file that finds no room
def test_a_disk_that_fills_up(size, every, what, script, small_disk, tmp_path):
    libc.mount(b"tmpfs", str(small_disk).encode(), b"tmpfs", REMOUNT, f"size={size}k".encode())
    run = start(script, small_disk, every)
    _, errors = run.communicate(timeout=120)
    assert run.returncode == 1
    left = check_what_is_left(small_disk, errors, f"ngswell.errors.OutputError: {what}")
    assert "could not be written" in errors
    assert "No space left on device" in errors or "is the disk full?" in errors
    assert (0.0 < left.snapshot.time < 60.0) if every == 0.0 else left.snapshot.time == 0.0
    libc.mount(b"tmpfs", str(small_disk).encode(), b"tmpfs", REMOUNT, b"size=16m")  # space is made
    run = start(script, small_disk)
    assert run.stdout.readline() == f"from {left.snapshot.time:g} s\n"
    assert run.wait() == 0, run.stderr.read()
    whole = tmp_path / "whole"
    whole.mkdir()
    run = start(script, whole)
    assert run.wait() == 0
    assert results(small_disk) == results(whole)


def test_a_limit_on_file_sizes(script, tmp_path):
    # The same without any right: the checkpoint outgrows what a file may have.
    limit = 20_000 + 8 * 5_000
    run = start(
        script, tmp_path, ballast=5_000, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    )
    _, errors = run.communicate(timeout=120)
    assert run.returncode == 1
    left = check_what_is_left(
        tmp_path, errors, "ngswell.errors.OutputError: Checkpoint: run could not be written (File too large)"
    )
    assert left.snapshot.time < 60.0


FULL = """
import resource
from ngswell import CSV, OutputError
from ngswell.streams import Stream

stream = Stream(CSV("J.csv"), "Probe")
stream.begin()
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
try:
    while True:
        stream.write([0.1, "0.123456789"])
except OutputError as error:
    print(error)
print(stream.state()["written"][0])
"""


def test_a_record_that_finds_no_room_is_not_begun(tmp_path):
    said = subprocess.run(
        [sys.executable, "-c", FULL], cwd=tmp_path, text=True, capture_output=True, check=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    ).stdout  # fmt: skip
    assert said.startswith("Probe: J.csv could not be written (it is cut short; is the disk full?)")
    assert said.endswith("\n96\n")
    assert (tmp_path / "J.csv").read_text() == 6 * "0.1,0.123456789\n"


def test_a_read_only_disk(script, small_disk):
    libc.mount(b"tmpfs", str(small_disk).encode(), b"tmpfs", REMOUNT | READ_ONLY, b"size=256k")
    run = start(script, small_disk)
    out, errors = run.communicate(timeout=120)
    assert run.returncode == 1
    assert "from" not in out
    assert "cannot be written to" in errors.splitlines()[-1]
    with pytest.raises(OutputError, match="cannot be written to"):
        prepare(small_disk, ["study"], overwrite=True)


def test_a_study_on_a_full_disk_leaves_the_results_before(small_disk):
    def findings(rows):
        return Findings(Figure(), ("a", "b"), [(1.0, 2.0)] * rows, {"c": 1.0})

    write(small_disk, "study", findings(1))
    before = {file.name: file.read_bytes() for file in small_disk.iterdir()}
    assert sorted(before) == ["study.csv", "study.json", "study.png"]
    with pytest.raises(OutputError, match=r"No space left on device.*unchanged"):
        write(small_disk, "study", findings(200_000))
    assert {file.name: file.read_bytes() for file in small_disk.iterdir()} == before


def test_a_study_that_is_interrupted_says_so_in_one_line(tmp_path):
    run = subprocess.Popen(
        [sys.executable, "-m", "studies", "boundary_charge", "--quick", "--out", str(tmp_path)],
        cwd=Path(__file__).parents[2], text=True, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert run.stderr.readline() == "boundary_charge: started\n"
    time.sleep(0.2)
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 130, errors
    assert "Traceback" not in errors
    assert errors.splitlines()[-1].startswith("studies: interrupted")
    assert not list(tmp_path.iterdir())
