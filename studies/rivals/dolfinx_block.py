"""The free-swelling block in DOLFINx: the same unknowns, steps and kept factors on generated C kernels and MUMPS.

Written for the interface of DOLFINx 0.5 (Debian 12: `apt-get install python3-dolfinx libopenblas0-pthread`):

    /usr/bin/python3 -m studies.rivals.dolfinx_block --nx 22 --ny 20 --grade 1 --order 2 --scheme euler --tolerance 1e-3
    /usr/bin/python3 -m studies.rivals.dolfinx_block --kernels 44x40 88x80

The second measures tangent, residual, factorisation and solve of both models, in CPU milliseconds, medians of turns.
Quadrature of degree 2k + 2 has k + 2 points a direction, as NGSolve's order 2k + 2. No static condensation: it has none.
"""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Callable
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import dolfinx
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as meshes
from dolfinx.fem import petsc
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from studies.rivals.block import (
    CFC0,
    D_MINUS,
    D_PLUS,
    HEIGHT,
    LAM,
    MU,
    NS0,
    RT,
    SAMPLES,
    WIDTH,
    Grid,
    K,
    baths,
    bottom_share,
    charge,
)  # fmt: skip
from studies.rivals.integrate import serve
from studies.rivals.turns import milliseconds

FLAGS = ["-O3", "-march=native"]


class DOLFINxBlock:
    """Forms, matrix and vectors for `integrate.Run`; `model` "potential", or for its kernels only "concentration"."""

    def __init__(self, grid: Grid, model: str = "potential") -> None:
        logging.disable(logging.INFO)
        self.grid = grid
        self.mesh = meshes.create_rectangle(
            MPI.COMM_SELF, [[0.0, 0.0], [1.0, 1.0]], [grid.nx, grid.ny], meshes.CellType.quadrilateral
        )
        nodes = self.mesh.geometry.x
        for axis, lines in enumerate(grid.lines()):
            nodes[:, axis] = np.interp(nodes[:, axis], np.linspace(0, 1, len(lines)), lines)
        cell = self.mesh.ufl_cell()
        V, Q = ufl.VectorElement("Q", cell, grid.order), ufl.FiniteElement("Q", cell, grid.order - 1)
        self.space = fem.FunctionSpace(self.mesh, ufl.MixedElement([V, Q, Q] if model == "potential" else [V, Q, Q, Q]))
        self.fields, self.zero = fem.Function(self.space), fem.Function(self.space)
        self.unknowns = len(self.fields.x.array)
        self.parts = [np.array(self.space.sub(n).collapse()[1]) for n in range(self.space.num_sub_spaces)]
        self.charge, self.step_size = (fem.Constant(self.mesh, PETSc.ScalarType(1.0)) for _ in range(2))
        self._forms(model)
        self._boundary()
        self.matrix, self.vector = petsc.create_matrix(self.form), petsc.create_vector(self.balance)
        self.correction = self.vector.duplicate()
        self.solver: Any = None

    def _forms(self, model: str) -> None:
        tests, dx = ufl.TestFunctions(self.space), ufl.Measure("dx", metadata={"quadrature_degree": 2 * self.grid.order + 2})
        u = ufl.split(self.fields)[0]
        v, q, d = tests[:3]
        F = ufl.Identity(2) + ufl.grad(u)
        J, cof = ufl.det(F), ufl.as_matrix([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])
        content = J - NS0
        fixed = self.charge * ((1 - NS0) * CFC0)
        pressure, fluid, ions, plus = (of_potential if model == "potential" else of_concentration)(
            ufl.split(self.fields)[1:], fixed / content, 1 - NS0 / J
        )
        pull = self.step_size / J * (cof.T * cof)
        stress = MU * F + (LAM * (1 - NS0) ** 2 * (1 / (1 - NS0) - 1 / content) - MU / J - pressure) * cof
        storage = (content * q + content * plus * d) * dx
        balance = storage + (ufl.inner(stress, ufl.grad(v)) - ufl.inner(pull * fluid, ufl.grad(q))) * dx
        balance -= ufl.inner(pull * ions, ufl.grad(d)) * dx
        if model == "concentration":
            balance += (content * ufl.split(self.fields)[3] - fixed) * tests[3] * dx
        jit = {"cffi_extra_compile_args": FLAGS, "cffi_libraries": ["m"]}
        tangent = ufl.derivative(balance, self.fields, ufl.TrialFunction(self.space))
        self.form, self.balance, self.storage, self.volume = (
            fem.form(form, jit_params=jit) for form in (tangent, balance, storage, J * dx)
        )
        self.pressure = pressure

    def _boundary(self) -> None:
        def on(test: Callable[[NDArray], NDArray], *sub: int) -> NDArray:
            space = self.space
            for number in sub:
                space = space.sub(number)
            return fem.locate_dofs_topological(space, 1, meshes.locate_entities_boundary(self.mesh, 1, test))

        def at_baths(x: NDArray) -> NDArray:
            return np.isclose(x[0], 0) | np.isclose(x[1], 0) | np.isclose(x[1], HEIGHT)

        corner = meshes.locate_entities_boundary(self.mesh, 0, lambda x: np.isclose(x[0], 0) & np.isclose(x[1], 0))
        pin = fem.locate_dofs_topological(self.space.sub(0).sub(1), 0, corner)
        fixed = [on(lambda x: np.isclose(x[0], WIDTH), 0, 0), pin, on(at_baths, 1), on(at_baths, 2)]
        self.conditions = [fem.dirichletbc(self.zero, numbers) for numbers in fixed]
        self.fixed, self.salt = np.concatenate(fixed), fixed[3]
        Q, numbers = self.space.sub(2).collapse()
        where = dict(zip(numbers, Q.tabulate_dof_coordinates(), strict=True))
        points = np.array([where[number] for number in self.salt])
        self.below = bottom_share(points[:, 0], points[:, 1])
        self.at_baths = fixed[2]

    def start(self) -> NDArray:
        state = np.zeros(self.unknowns)
        state[self.parts[2]] = 4.1
        return state

    def at(self, time: float) -> None:
        self.charge.value = charge(time)
        self.side, self.bottom = baths(time)

    def prescribe(self, state: NDArray) -> None:
        state[self.at_baths] = 0.0
        state[self.salt] = self.side + (self.bottom - self.side) * self.below

    def residual(self, state: NDArray, step: float) -> NDArray:
        self.step_size.value = step
        return self._assemble(self.balance, state)

    def content(self, state: NDArray) -> NDArray:
        return self._assemble(self.storage, state)

    def _assemble(self, form: Any, state: NDArray) -> NDArray:
        self.fields.x.array[:] = state
        with self.vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self.vector, form)
        found = self.vector.array.copy()
        found[self.fixed] = 0.0
        return found

    def factorise(self, state: NDArray, step: float) -> None:
        self.step_size.value = step
        self.assemble_tangent(state)
        self.factorise_matrix()

    def assemble_tangent(self, state: NDArray) -> None:
        self.fields.x.array[:] = state
        if self.solver is not None:  # before the first assembly zeroing would drop the pattern
            self.matrix.zeroEntries()
        petsc.assemble_matrix(self.matrix, self.form, self.conditions)
        self.matrix.assemble()

    def factorise_matrix(self) -> None:
        if self.solver is None:
            self.solver = PETSc.KSP().create(MPI.COMM_SELF)
            self.solver.setType("preonly")
            self.solver.getPC().setType("lu")
            self.solver.getPC().setFactorSolverType("mumps")
        self.matrix.stateIncrease()
        self.solver.setOperators(self.matrix)
        self.solver.setUp()

    def solve(self, residual: NDArray) -> NDArray:
        self.vector.array[:] = residual
        self.solver.solve(self.vector, self.correction)
        return self.correction.array.copy()

    def sizes(self, state: NDArray) -> tuple[float, float, float]:
        u, P, salt = (float(np.abs(state[part]).max()) for part in self.parts[:3])
        return u, P, salt

    def area(self, state: NDArray) -> float:
        self.fields.x.array[:] = state
        return float(fem.assemble_scalar(self.volume))

    def pressures(self, state: NDArray, time: float) -> NDArray:
        """Interpolated in each cell two orders higher than the displacement, and read at the samples."""
        self.at(time)
        self.fields.x.array[:] = state
        space = fem.FunctionSpace(self.mesh, ("DQ", self.grid.order + 2))
        points, pressure = space.element.interpolation_points, fem.Function(space)
        pressure.interpolate(fem.Expression(self.pressure, points() if callable(points) else points))
        middles = meshes.compute_midpoints(self.mesh, 2, range(self.grid.nx * self.grid.ny))
        cells = {self._place(middle): number for number, middle in enumerate(middles)}
        within = np.column_stack([SAMPLES, np.zeros(len(SAMPLES))])
        return pressure.eval(within, [cells[self._place(sample)] for sample in within]).ravel()

    def _place(self, point: NDArray) -> tuple[int, ...]:
        return tuple(int(np.searchsorted(lines, at)) for lines, at in zip(self.grid.lines(), point, strict=False))


def of_potential(fields: tuple, cfc: Any, nF: Any) -> tuple[Any, Any, Any, Any]:
    """Pressure, fluxes of fluid and cations, and cations, from P and c̃."""
    P, salt = fields
    root = ufl.sqrt(salt * salt + cfc * cfc / 4)
    plus, D_L = root + cfc / 2, cfc * (K * RT) / nF
    drive = ufl.grad(P) - 2 * RT * ufl.grad(salt)
    of_anions = (salt / plus) * ufl.grad(salt)
    theta = D_PLUS * plus + D_MINUS * (plus - cfc) + D_L * cfc
    of_cations = (2 * (D_MINUS - D_L) * of_anions - D_L / RT * drive) / theta
    fluid = -K * (drive + RT * (cfc * of_cations + 2 * of_anions))
    return P + 2 * RT * (root - salt), fluid, -nF * D_PLUS * plus * of_cations + plus * fluid, plus


def of_concentration(fields: tuple, at_point: Any, nF: Any) -> tuple[Any, Any, Any, Any]:
    """The same from p, c and a continuous charge field; the momentum balance sees the charge at the point."""
    p, c, cfc = fields
    D_L = cfc * (K * RT) / nF
    theta = D_PLUS * c + D_MINUS * (c - cfc) + D_L * cfc
    field = -(D_L / RT * ufl.grad(p) - (D_MINUS - D_PLUS) * ufl.grad(c) + D_MINUS * ufl.grad(cfc)) / theta
    fluid = -K * (ufl.grad(p) + RT * cfc * field)
    pressure = p + 2 * RT * (ufl.sqrt(c * (c - cfc) + at_point * at_point / 4) - c + cfc / 2)
    return pressure, fluid, -nF * D_PLUS * (ufl.grad(c) + c * field) + c * fluid, c


def kernels(cells: tuple[int, int], model: str, turns: int = 7) -> dict[str, float | int]:
    """CPU milliseconds of the parts of an iteration near the swollen rest state in 4.1 mol/l, and what they are of."""
    block = DOLFINxBlock(Grid(*cells), model)
    state, (V, numbers) = np.zeros(block.unknowns), block.space.sub(0).collapse()
    swollen = fem.Function(V)
    swollen.interpolate(lambda x: 0.19 * x[:2])
    state[numbers] = swollen.x.array
    for part, value in zip(block.parts[1:], (0.0, 4.1) if model == "potential" else (0.04, 4.37, 0.52), strict=True):
        state[part] = value
    state *= 1 + 1e-4 * np.random.default_rng(8).standard_normal(block.unknowns)
    block.factorise(state, 10.0)
    residual = block.residual(state, 10.0)
    actions: dict[str, Callable[[], object]] = {
        "tangent": lambda: block.assemble_tangent(state),
        "residual": lambda: block.residual(state, 10.0),
        "factorise": block.factorise_matrix,
        "solve": lambda: block.solve(residual),
    }
    return {
        **{f"{name}_ms": taken for name, taken in milliseconds(actions, turns).items()},
        "unknowns": block.unknowns,
        "points": (block.grid.order + 2) ** 2,
    }


def versions() -> str:
    """DOLFINx and PETSc."""
    return f"DOLFINx {dolfinx.__version__}, PETSc {'.'.join(map(str, PETSc.Sys.getVersion()))}, {' '.join(FLAGS)}"


if __name__ == "__main__":
    if not dolfinx.__version__.startswith("0.5."):
        sys.exit(f"dolfinx_block is written for DOLFINx 0.5, got {dolfinx.__version__}; remedy: Debian 12's python3-dolfinx")
    if sys.argv[1:2] == ["--versions"]:
        print(versions())
    elif sys.argv[1:2] == ["--kernels"]:
        for text in sys.argv[2:]:
            nx, ny = map(int, text.split("x"))
            for model in ("potential", "concentration"):
                print(json.dumps({"cells": text, "model": model, **kernels((nx, ny), model)}), flush=True)
    else:
        serve(lambda grid, _: DOLFINxBlock(grid))
