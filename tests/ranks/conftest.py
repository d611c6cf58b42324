"""Starts ranks for tests."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LIMIT = 300
"""Seconds after which ranks that wait for each other are ended; the tests take some ten."""

Together = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def together() -> Together:
    """Runs Python with the arguments on so many ranks, more than there are cores, too."""
    pytest.importorskip("mpi4py", reason="ranks need mpi4py and an MPI: pip install ngswell[mpi]")
    mpirun = shutil.which("mpirun", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
    if mpirun is None:
        pytest.skip("ranks need mpirun: pip install ngswell[mpi]")

    def run(ranks: int, *arguments: str, limit: float = LIMIT) -> subprocess.CompletedProcess[str]:
        allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
        allowed["OMPI_MCA_mpi_yield_when_idle"] = "1"  # else ranks that wait take the cores from those that compute
        command = [mpirun, "--oversubscribe", "-n", str(ranks), sys.executable, *arguments]
        environment = {**os.environ, **allowed, "NGS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
        return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=limit, check=False)

    return run
