"""PETSc's solvers on ranks: what one rank computes, and the same refusal on all."""

import pytest

from ngswell.solve import petsc_factors

pytestmark = pytest.mark.skipif(petsc_factors.why_not() is not None, reason="petsc4py is not installed")

ASM = {"ksp_type": "gmres", "ksp_rtol": 1e-8, "pc_type": "asm", "sub_pc_type": "lu"}
RUN = """
import numpy as np
from ngswell import Fixed, PETScSolver
from tests.ranks.scenes import cube

scene = cube(ranks=True)
found = scene.run(10.0, Fixed(10.0), unstable="off", solver=PETScSolver({options})).end.values
here = cube().run(10.0, Fixed(10.0), unstable="off").end.values
print("difference", np.abs(found - here).max())
"""


def test_an_iteration_on_two_ranks_gives_what_one_computes(together):
    ended = together(2, "-c", RUN.format(options=ASM))
    assert ended.returncode == 0, ended.stderr
    differences = [float(line.split()[1]) for line in ended.stdout.splitlines() if line.startswith("difference")]
    assert len(differences) == 2
    assert max(differences) < 1e-7  # ten of Newton's tolerances, of numbers of the size of one


def test_an_option_that_is_not_used_ends_all_ranks(together):
    said = together(2, "-c", RUN.format(options={**ASM, "sub_pc_tpye": "lu"}))
    assert said.returncode == 1
    assert "PETSc has not used 'sub_pc_tpye'" in said.stderr


def test_without_a_name_it_is_mumps(together):
    said = together(2, "-c", "from tests.ranks.scenes import cube; print(cube(ranks=True).describe())")
    assert "linear solver: MUMPS by PETSc, on all ranks" in said.stdout
