"""The free-swelling block in NGSolve as an expert writes it: chemical potentials as unknowns, an integrator a term in C++.

Displacement of order k, P and c̃ of order k − 1 (baths are exact Dirichlet values), condensation, Pardiso, kept factors:

    python -m studies.rivals.good_ngsolve --nx 22 --ny 20 --grade 1 --order 2 --scheme euler --tolerance 1e-3
"""

from __future__ import annotations

from importlib import metadata

import numpy as np
from ngsolve import (
    CF,
    H1,
    VERTEX,
    BilinearForm,
    Cof,
    Det,
    FESpace,
    GridFunction,
    Id,
    IfPos,
    InnerProduct,
    Integrate,
    NodeId,
    Parameter,
    Variation,
    VectorH1,
    dx,
    grad,
    log,
    sqrt,
    x,
    y,
)  # fmt: skip
from ngsolve.meshes import MakeStructured2DMesh
from numpy.typing import NDArray

from studies.rivals.block import (
    BLENDED,
    CFC0,
    D_MINUS,
    D_PLUS,
    LAM,
    MU,
    NS0,
    RT,
    SAMPLES,
    Grid,
    K,
    baths,
    charge,
)  # fmt: skip
from studies.rivals.integrate import serve


def solver() -> str:
    """Pardiso where MKL is installed, else UMFPACK."""
    try:
        metadata.version("mkl")
    except metadata.PackageNotFoundError:
        return "umfpack"
    return "pardiso"


class NGSolveBlock:
    """Forms and vectors for `integrate.Run`. Terms go through the C++ compiler, which takes tens of seconds."""

    def __init__(self, grid: Grid, bytecode: bool = False) -> None:
        across, along = grid.lines()
        self.mesh = MakeStructured2DMesh(
            quads=True, nx=grid.nx, ny=grid.ny,
            mapping=lambda s, t: (float(np.interp(s * grid.nx, range(grid.nx + 1), across)),
                                  float(np.interp(t * grid.ny, range(grid.ny + 1), along))),
        )  # fmt: skip
        V = VectorH1(self.mesh, order=grid.order, dirichletx="right")
        Q = H1(self.mesh, order=grid.order - 1, dirichlet="left|top|bottom")
        self.space = FESpace([V, Q, Q])
        self.fields = GridFunction(self.space)
        self.charge, self.step = Parameter(0.0), Parameter(1.0)
        self.unknowns = self.space.ndof
        self._pin(V)
        self._forms(not bytecode)
        self._boundary()

    def _pin(self, V: FESpace) -> None:
        free = self.space.FreeDofs()
        for v in self.mesh.vertices:
            if abs(v.point[0]) + abs(v.point[1]) < 1e-9:
                free.Clear(V.GetDofNrs(NodeId(VERTEX, v.nr))[1])
        self.free = np.array(list(free))
        coupling = self.space.FreeDofs(coupling=True)
        for number in np.flatnonzero(~self.free):
            coupling.Clear(int(number))
        self.coupling = coupling

    def _forms(self, compiled: bool) -> None:
        (u, P, salt), (v, q, d) = self.space.TnT()
        rule = dx(bonus_intorder=2)
        F = Id(2) + grad(u)
        J, cof = Det(F), Cof(F)
        content, nF = J - NS0, 1 - NS0 / J
        cfc = self.charge * ((1 - NS0) * CFC0) / content
        plus = sqrt(salt * salt + cfc * cfc / 4) + cfc / 2
        pressure = P + 2 * RT * (plus - cfc / 2 - salt)
        D_L = cfc * (K * RT) / nF
        drive = grad(P) - 2 * RT * grad(salt)
        of_anions = (salt / plus) * grad(salt)
        of_cations = (2 * (D_MINUS - D_L) * of_anions - D_L / RT * drive) / (
            D_PLUS * plus + D_MINUS * (plus - cfc) + D_L * cfc
        )
        fluid = -K * (drive + RT * (cfc * of_cations + 2 * of_anions))
        cations = -nF * D_PLUS * plus * of_cations + plus * fluid
        pull = self.step / J * (cof.trans * cof)
        energy = MU / 2 * InnerProduct(F, F) - MU * log(J) + LAM * (1 - NS0) ** 2 * (J / (1 - NS0) - log(content))

        def made(term: CF) -> CF:
            return term.Compile(realcompile=True, wait=True) if compiled else term.Compile()

        stored = [made(content * q) * rule, made(content * plus * d) * rule]
        self.form = BilinearForm(self.space, condense=True)
        self.storage = BilinearForm(self.space, nonassemble=True)
        self.form += Variation(made(energy) * rule)
        for term in (
            -pressure * InnerProduct(cof, grad(v)),
            -InnerProduct(pull * fluid, grad(q)),
            -InnerProduct(pull * cations, grad(d)),
        ):
            self.form += made(term) * rule
        for integral in stored:
            self.form += integral
            self.storage += integral
        u, P, salt = self.fields.components
        J = Det(Id(2) + grad(u))
        cfc = self.charge * ((1 - NS0) * CFC0) / (J - NS0)
        self.volume, self.pressure = J, P + 2 * RT * (sqrt(salt * salt + cfc * cfc / 4) - salt)
        self.residual_vector, self.work, self.correction = (self.fields.vec.CreateVector() for _ in range(3))
        self.inverse = None

    def _boundary(self) -> None:
        """Coefficients of 1 and of the share of the bath below on the boundary; baths are their combinations."""
        salt, vectors = self.fields.components[2], []
        fade_x, fade_y = (0.5 * _fading(at) for at in (x, y))
        for values in ({"left": 1.0, "bottom": 1.0, "top": 1.0}, {"left": fade_y, "bottom": 1 - fade_x, "top": 0.0}):
            self.fields.vec[:] = 0.0
            salt.Set(self.mesh.BoundaryCF(values), definedon=self.mesh.Boundaries("left|bottom|top"))
            vectors.append(self.fields.vec.FV().NumPy().copy())
        self.ones, self.below = vectors
        self.prescribed = np.zeros(self.unknowns, dtype=bool)
        part = self.space.Range(2)
        self.prescribed[part.start : part.stop] = ~self.free[part.start : part.stop]

    def start(self) -> NDArray:
        self.fields.vec[:] = 0.0
        self.fields.components[2].Set(4.1)
        return self.fields.vec.FV().NumPy().copy()

    def at(self, time: float) -> None:
        self.charge.Set(charge(time))
        self.side, self.bottom = baths(time)

    def prescribe(self, state: NDArray) -> None:
        at = self.prescribed
        state[at] = (self.side * self.ones + (self.bottom - self.side) * self.below)[at]

    def residual(self, state: NDArray, step: float) -> NDArray:
        self.step.Set(step)
        return self._apply(self.form, state)

    def content(self, state: NDArray) -> NDArray:
        return self._apply(self.storage, state)

    def _apply(self, form: BilinearForm, state: NDArray) -> NDArray:
        self.fields.vec.FV().NumPy()[:] = state
        form.Apply(self.fields.vec, self.residual_vector)
        return np.where(self.free, self.residual_vector.FV().NumPy(), 0.0)

    def factorise(self, state: NDArray, step: float) -> None:
        self.step.Set(step)
        self.fields.vec.FV().NumPy()[:] = state
        self.form.AssembleLinearization(self.fields.vec)
        if self.inverse is None:
            self.inverse = self.form.mat.Inverse(self.coupling, inverse=solver())
        else:
            self.inverse.Update()

    def solve(self, residual: NDArray) -> NDArray:
        form, work = self.form, self.work
        work.FV().NumPy()[:] = residual
        work.data += form.harmonic_extension_trans * work
        self.correction.data = self.inverse * work
        self.correction.data += form.harmonic_extension * self.correction
        self.correction.data += form.inner_solve * work
        return self.correction.FV().NumPy().copy()

    def sizes(self, state: NDArray) -> tuple[float, float, float]:
        u, P, salt = (float(np.abs(state[part.start : part.stop]).max()) for part in map(self.space.Range, range(3)))
        return u, P, salt

    def area(self, state: NDArray) -> float:
        self.fields.vec.FV().NumPy()[:] = state
        return Integrate(self.volume, self.mesh, order=8)

    def pressures(self, state: NDArray, time: float) -> NDArray:
        self.at(time)
        self.fields.vec.FV().NumPy()[:] = state
        return self.pressure(self.mesh(*SAMPLES.T)).ravel()


def _fading(distance: CF) -> CF:
    return IfPos(BLENDED - distance, (BLENDED - distance) / BLENDED, 0.0)


if __name__ == "__main__":
    serve(NGSolveBlock)
