"""The study of ranks at its quick size. Seconds depend on who else computes: none is tested."""

import pytest

from ngswell import InputError
from studies.choices import scaling
from tests.studies.quick import quick


def test_scaling(tmp_path):
    pytest.importorskip("mpi4py", reason="ranks need mpi4py and an MPI: pip install ngswell[mpi]")
    try:
        scaling.mpirun()
    except InputError:
        pytest.skip("ranks need mpirun: pip install ngswell[mpi]")
    numbers, rows = quick("scaling", tmp_path)
    solvers = numbers["solvers"].split(", ")
    assert len(rows) - 1 == len(scaling.RANKS) * (len(solvers) + 1)
    for prefix in ("", *(f"{solver}_" for solver in solvers if solver != "two_level")):
        assert numbers[f"{prefix}calls_per_iteration_1"] == 0
        for ranks in scaling.RANKS[1:]:
            # The same decisions are taken; sums differ by their order, 1e-16 of the largest, and what a matrix makes of it.
            assert numbers[f"{prefix}iterations_{ranks}"] == numbers[f"{prefix}iterations_1"]
            assert numbers[f"{prefix}largest_difference_{ranks}"] < 1e-10
            assert numbers[f"{prefix}bytes_per_iteration_{ranks}"] > 8 * numbers["strong_unknowns"]  # a residual at least
    # The coarse level and patches are those of the whole body, on any number of ranks.
    assert numbers["krylov_iterations_4"] == pytest.approx(numbers["krylov_iterations_1"], abs=0.5)


def test_without_mpirun_it_says_so(monkeypatch):
    monkeypatch.setattr(scaling.shutil, "which", lambda *_, **__: None)
    with pytest.raises(InputError, match="no mpirun"):
        scaling.run(quick=True)
