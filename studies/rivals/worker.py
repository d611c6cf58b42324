"""A rival in a process of its own: built once, run whenever asked."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
ONE_THREAD = dict.fromkeys(("NGS_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class Worker:
    """`python -m module --serve` with options of `integrate.serve`: one thread, compilers' words kept away."""

    def __init__(self, python: str, module: str, options: Sequence[object]) -> None:
        self._process = subprocess.Popen(
            [python, "-m", module, "--serve", *map(str, options)], cwd=ROOT, env=_environment(), text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self.setup: float | None = None

    def ready(self) -> None:
        """Wait until it is built."""
        if self.setup is None:
            self.setup = self._answer()["setup"]

    def ask(self, scheme: str, tolerance: float) -> dict[str, Any] | None:
        """A run from start to end, as `integrate.outcome` describes it; None if it gives up."""
        self.ready()
        assert self._process.stdin is not None
        print(scheme, tolerance, file=self._process.stdin, flush=True)
        found = self._answer()
        return None if "failed" in found else found

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):  # compilers speak here as well
                return json.loads(line)
        raise RuntimeError(f"{self._process.args!r} ended with {self._process.wait()} and without an answer")

    def close(self) -> None:
        """End the process."""
        self._process.communicate("")


ABSENT = "absent: no python with DOLFINx 0.5; name one with --dolfinx"


def add_dolfinx(parser: argparse.ArgumentParser) -> None:
    """`--dolfinx PYTHON`."""
    parser.add_argument("--dolfinx", metavar="PYTHON", help="a python with DOLFINx 0.5, to compare with")


def usable(python: str | None) -> str | None:
    """What DOLFINx that python has; None, and one message if a python was named, where it has none of use."""
    found = python and versions(python)
    if python and not found:
        print(f"{python} has no DOLFINx 0.5: left out", file=sys.stderr)
    return found or None


def versions(python: str) -> str | None:
    """What DOLFINx another python has; None if it has none that `dolfinx_block` can use."""
    try:
        done = _once(python, "--versions")
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def kernels(python: str, cells: tuple[int, int]) -> dict[str, dict[str, float]]:
    """Milliseconds of the parts of an iteration in DOLFINx, by model: see `dolfinx_block`."""
    lines = _once(python, "--kernels", "{}x{}".format(*cells)).stdout.splitlines()
    answers = [json.loads(line) for line in lines if line.startswith("{")]
    return {answer["model"]: answer for answer in answers}


def _once(python: str, *options: str) -> subprocess.CompletedProcess[str]:
    command = [python, "-m", "studies.rivals.dolfinx_block", *options]
    return subprocess.run(command, cwd=ROOT, env=_environment(), capture_output=True, text=True)


def _environment() -> dict[str, str]:
    """One thread, and nothing of the python that runs the studies."""
    return {**{name: value for name, value in os.environ.items() if name != "PYTHONPATH"}, **ONE_THREAD}


def machine() -> str:
    """Processor and number of cores."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        name = "unknown processor"
    return f"{name}, {os.cpu_count()} cores"
