"""What do ranks of MPI gain, in time and in memory, and what do they say to each other?

The second of two steps of 10 s of an eighth of the swelling block (`growth`), with a matrix an iteration, on
1, 2 and 4 ranks that mpirun starts on whatever cores there are. Strong: one body; weak: 1, 2 and 4 times the cells. Solvers:
"gathered" (the first rank factorises), "mumps" (PETSc, where petsc4py is) and "two_level". Keys are those of the two-level
solver, others' have their name before them; N is the number of ranks:

- `cpu_seconds_per_rank_N`: CPU of the busiest rank outside calls of MPI, `waiting_seconds_per_rank_N` within them, where it
  waits at work. MUMPS' own messages are not seen from outside: its seconds hold its waiting;
- `iterations_N`: of Newton's method; `krylov_iterations_N`: in a solve, on average;
- `largest_difference_N`: of the fields to those of one rank, in units of each; `memory_per_rank_N` [bytes]: largest peak;
- `calls_per_iteration_N`, `bytes_per_iteration_N`: collective calls of a rank, and what it hands over, by Newton iteration;
- `weak_...`: the same with the body growing; `strong_unknowns`, `weak_unknowns_N`; `largest_body_unknowns`,
  `largest_body_memory_per_rank`, `largest_body_ranks`: the largest that was computed;
- `model_seconds_R`, R = 64, 1024: a MODEL, not measured: an iteration of the strong body as a + b / R, fitted to the seconds
  above, with calls of `LATENCY` log₂ R and bytes at `BANDWIDTH`, counted on 4 ranks. `model_speedup_R`: over one rank.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from math import log2
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray
from tqdm import tqdm

from ngswell import InputError
from ngswell.solve.petsc_factors import why_not
from studies.output import Findings, letter_panels

RANKS = (1, 2, 4)
STRONG, QUICK_STRONG = 10, 4
"""Cells along each edge."""
WEAK, QUICK_WEAK = {1: 7, 2: 9, 4: 11}, {1: 3, 2: 4, 4: 5}
"""The same by ranks: of nearly equal numbers of cells a rank."""
LARGEST = 20
"""Cells of the largest body, on four ranks by the two-level solver."""
LATENCY, BANDWIDTH = 2e-6, 5e9
"""Assumed in the model: seconds of a message between two nodes, bytes a second of each."""
FAR = (64, 1024)
LIMIT = 3600.0
"""Seconds after which ranks are ended."""
NAMES = {"gathered": "first rank factorises", "mumps": "MUMPS", "two_level": "two-level"}
STYLES = {"gathered": ("o-", "0.0"), "mumps": ("^--", "0.45"), "two_level": ("P-", "0.45")}


@dataclass(frozen=True)
class Told:
    """What a number of ranks told of one body, and the fields in units of their size."""

    solver: str
    cells: int
    ranks: int
    unknowns: int
    newton: int
    krylov: int
    solves: int
    seconds: list[float]
    waiting: list[float]
    calls: list[int]
    bytes: list[int]
    peak: list[int]
    fields: NDArray

    @property
    def computing(self) -> float:
        """CPU seconds of the busiest rank, without those in calls of MPI, in an iteration of Newton's method."""
        return max(a - b for a, b in zip(self.seconds, self.waiting, strict=True)) / self.newton


def mpirun() -> str:
    """Where mpirun is. Raises InputError where there is none."""
    beside = str(Path(sys.executable).parent)
    found = shutil.which("mpirun", path=os.pathsep.join([beside, os.environ.get("PATH", "")]))
    if found is None:
        raise InputError('scaling: there is no mpirun, so nothing is computed; pip install "ngswell[mpi]", or your own MPI')
    return found


def compute(launcher: str, solver: str, cells: int, ranks: int) -> Told:
    """One body on so many ranks, in processes of their own. Raises InputError where they fail."""
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    one = {"NGS_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    root = str(Path(__file__).parents[2])
    path = os.pathsep.join([root, *os.environ.get("PYTHONPATH", "").split(os.pathsep)])
    with TemporaryDirectory() as folder:
        out = str(Path(folder) / "told")
        command = [launcher, "--oversubscribe", "-n", str(ranks), sys.executable, "-m", "studies.choices.scaling_worker"]
        ended = subprocess.run(
            [*command, solver, str(cells), out],
            env={**os.environ, **allowed, **one, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
        )
        if ended.returncode:
            raise InputError(
                f"scaling: {ranks} ranks with {solver} on {cells}^3 cells failed: {ended.stderr.strip()[-600:]}"
            )
        told: dict[str, Any] = json.loads(Path(out + ".json").read_text(encoding="utf-8"))
        return Told(solver, cells, fields=np.load(out + ".npy"), **told)


def run(quick: bool = False) -> Findings:
    """All solvers on all numbers of ranks."""
    launcher = mpirun()
    solvers = ["gathered", *([] if why_not() else ["mumps"]), "two_level"]
    strong, weak = (QUICK_STRONG, QUICK_WEAK) if quick else (STRONG, WEAK)
    tasks = [(solver, strong, ranks) for solver in solvers for ranks in RANKS]
    tasks += [("two_level", weak[ranks], ranks) for ranks in RANKS]
    if not quick:
        tasks += [("two_level", LARGEST, RANKS[-1])]
    done = [compute(launcher, *task) for task in tqdm(tasks, desc="scaling")]
    count = len(solvers) * len(RANKS)
    by_solver = {solver: [one for one in done[:count] if one.solver == solver] for solver in solvers}
    grown = done[count : count + len(RANKS)]
    largest = max(done, key=lambda one: one.unknowns)
    found: dict[str, float | int | str] = {
        "mesh": f"{strong}^3 hexahedra of order 2 (strong), {weak[1]}^3 to {weak[4]}^3 (weak)",
        "steps": 2 * len(done),
        "rejected_steps": 0,
        "newton_iterations": sum(one.newton for one in done),
        "seconds": round(sum(max(one.seconds) for one in done), 2),
        "cores": os.cpu_count() or 1,
        "solvers": ", ".join(solvers),
        "strong_unknowns": by_solver["two_level"][0].unknowns,
        "largest_body_unknowns": largest.unknowns,
        "largest_body_ranks": largest.ranks,
        "largest_body_memory_per_rank": max(largest.peak),
    }
    for solver, series in by_solver.items():
        found |= numbers("" if solver == "two_level" else f"{solver}_", series) | model(solver, series)
    found |= numbers("weak_", grown) | {f"weak_unknowns_{one.ranks}": one.unknowns for one in grown}
    header = [
        "solver",
        "cells",
        "ranks",
        "unknowns",
        "newton",
        "krylov",
        "computing_s",
        "waiting_s",
        "calls",
        "bytes",
        "peak",
    ]
    rows = [
        [one.solver, one.cells, one.ranks, one.unknowns, one.newton, one.krylov, one.computing]
        + [max(part) / one.newton for part in (one.waiting, one.calls, one.bytes)]
        + [max(one.peak)]
        for one in done
    ]
    return Findings(draw(by_solver, grown), header, rows, found)


def numbers(prefix: str, series: Sequence[Told]) -> dict[str, float | int | str]:
    """What a solver took, by ranks."""
    found: dict[str, float | int | str] = {}
    for one in series:
        found |= {
            f"{prefix}cpu_seconds_per_rank_{one.ranks}": one.computing * one.newton,
            f"{prefix}waiting_seconds_per_rank_{one.ranks}": max(one.waiting),
            f"{prefix}iterations_{one.ranks}": one.newton,
            f"{prefix}memory_per_rank_{one.ranks}": max(one.peak),
            f"{prefix}calls_per_iteration_{one.ranks}": max(one.calls) / one.newton,
            f"{prefix}bytes_per_iteration_{one.ranks}": max(one.bytes) / one.newton,
        }
        if one.krylov:
            found[f"{prefix}krylov_iterations_{one.ranks}"] = one.krylov / one.solves
        if one.unknowns == series[0].unknowns:
            found[f"{prefix}largest_difference_{one.ranks}"] = float(np.abs(one.fields - series[0].fields).max())
    return found


def fitted(series: Sequence[Told]) -> tuple[float, float]:
    """a and b of the seconds of an iteration, a + b / ranks, neither below zero."""
    over = np.array([[1.0, 1 / one.ranks] for one in series])
    a, b = np.linalg.lstsq(over, [one.computing for one in series], rcond=None)[0]
    if a < 0:
        return 0.0, float(np.mean([one.computing * one.ranks for one in series]))
    return float(a), max(float(b), 0.0)


def modelled(series: Sequence[Told], ranks: int) -> float:
    """Seconds of an iteration on `ranks` of a cluster: a model from counts, with an assumed latency and bandwidth."""
    a, b = fitted(series)
    last = series[-1]
    said = max(last.calls) * LATENCY * log2(ranks) + max(last.bytes) / BANDWIDTH
    return a + b / ranks + (said / last.newton if ranks > 1 else 0.0)


def model(solver: str, series: Sequence[Told]) -> dict[str, float | int | str]:
    """What the model says of many ranks; of MUMPS nothing, as its messages are not counted."""
    if solver == "mumps":
        return {}
    prefix = "" if solver == "two_level" else f"{solver}_"
    found: dict[str, float | int | str] = {}
    for ranks in FAR:
        found[f"{prefix}model_seconds_{ranks}"] = modelled(series, ranks)
        found[f"{prefix}model_speedup_{ranks}"] = modelled(series, 1) / modelled(series, ranks)
    return found


def draw(by_solver: dict[str, list[Told]], grown: Sequence[Told]) -> Figure:
    """Time and memory of a rank, what is said in an iteration, and the model."""
    figure, axes = plt.subplots(2, 2, figsize=(9.6, 7.2))
    (time, peak), (said, far) = axes
    for solver, series in by_solver.items():
        style, colour = STYLES[solver]
        given: dict[str, Any] = {"color": colour, "ms": 5, "lw": 1.3, "label": NAMES[solver]}
        ranks = [one.ranks for one in series]
        time.plot(ranks, [one.computing for one in series], style, **given)
        peak.plot(ranks, [max(one.peak) / 2**30 for one in series], style, **given)
        several = [one for one in series if one.ranks > 1]
        said.plot([one.ranks for one in several], [max(one.bytes) / one.newton / 2**20 for one in several], style, **given)
        if solver != "mumps":
            span = [2**power for power in range(round(log2(FAR[-1])) + 1)]
            far.plot(span, [modelled(series, ranks) for ranks in span], style[1:], **given)
            far.plot(ranks, [one.computing for one in series], style[0], color=colour, ms=5)
    time.plot([one.ranks for one in grown], [one.computing for one in grown], "s:", color="0.6", label="two-level, weak")
    first = by_solver["two_level"][0].computing
    time.plot(RANKS, [first / ranks for ranks in RANKS], "-", color="0.3", lw=0.6, label="1 / ranks")
    titles = ("computing, an iteration of Newton", "memory of a rank", "said by a rank, an iteration", "model, one body")
    labels = ("CPU time of a rank [s]", "largest peak [GiB]", "handed to MPI [MiB]", "time of an iteration [s]")
    for ax, title, label in zip((time, peak, said, far), titles, labels, strict=True):
        finish(ax, title, label, RANKS if ax is not far else (1, 4, *FAR))
    peak.set(yscale="linear", ylim=(0, None))
    time.set_ylim(top=4 * time.get_ylim()[1])  # room for what curves are
    time.legend(fontsize=7, ncols=2, loc="upper right")
    letter_panels(axes.flat)
    return figure


def finish(ax: Axes, title: str, label: str, ticks: Sequence[int]) -> None:
    """Names and scales of a panel."""
    ax.set(xscale="log", yscale="log", xlabel="ranks [-]", ylabel=label, title=title)
    ax.set_xticks(ticks, [str(tick) for tick in ticks])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.legend(fontsize=7)
