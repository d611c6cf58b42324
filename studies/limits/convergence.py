"""Why Newton's method may stop converging while a gel swells freely: three discretisations of one model.

Variants: `present` (`Concentration` as it is), and made here `smooth` (the smooth p in the momentum balance in place of
the pressure of local Donnan equilibrium), `elementwise` (smooth p, and the charge at the point with its elementwise
gradient, from second derivatives of u, in fluxes and baths: no charge field), `elementwise_pointwise` (the same with the
present pressure). The runs also have `potential`, the toolkit's default model with exact baths.

First a gel of Table 2 held sideways, its surface free of stress: F = diag(1, J). Then such a gel at rest, disturbed. Last
the free-swelling scene from its state at 7000 s. Numbers, V a variant, N the cells a side, each of 0.05 mm:

- `V_eigenvalue_N_J_...`: smallest eigenvalue of the momentum's tangent on displacements that move no fluid as far as the
  discrete p can see, in units of µ |Grad v|², at that J; `V_negative_N_J_...`: how many are negative;
- `V_critical_J_N`: where the smallest passes zero; closed forms for the surface of a half-space: `biot_critical_J`
  (incompressible), `solid_critical_J` (the solid's bulk stiffness alone), `drained_critical_J` (at rest with its bath);
- `V_held_eigenvalue_N`: the smallest at J = 3 with the surface held: the control, positive;
- `V_growth_N_bath_C`: fastest growth rate [1/s] of small perturbations at rest in C mol/l, `V_growing_N_bath_C`: how many;
- `V_measured_growth`: rate [1/s] at which the disturbed gel (4 × 4, 0.1 mol/l, steps of 1 ms) leaves its state of rest;
  `V_disturbance_STEP`: its amplitude at the end [mm], from 1e-8, with steps of `ms` (0.06 s) or `s` (60 s);
- `runs_passed`, `runs_failed`; per run (VARIANT_MESH_STEP, `_undamped`, `_disturbed` where so) `..._reached_s`,
  `..._wanted_s`, `..._first_rejection_s` (−1: none), `..._failed_solves`, `..._iterations` and, of the last failed solve,
  `..._field`, `..._x_mm`, `..._y_mm`, `..._reason`. A run is given up after 24 failed solves.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property
from time import perf_counter
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from ngsolve import (
    CF,
    ET,
    VOL,
    BilinearForm,
    CoefficientFunction,
    Cof,
    Grad,
    Id,
    InnerProduct,
    IntegrationRule,
    Norm,
    dx,
    specialcf,
    x,
    y,
)
from numpy.typing import NDArray

from ngswell import (
    TABLE_2,
    Area,
    Bath,
    Concentration,
    Fixed,
    Penalty,
    PlaneStrain,
    Potential,
    Probe,
    Roller,
    Scene,
    StepError,
    rectangle,
)
from ngswell.baths.bath import BathFields
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.models.concentration import State
from ngswell.models.model import Setting, Term
from ngswell.physics import donnan, laws
from ngswell.plotting import on_deformed_body
from ngswell.problem.problem import Problem, Snapshot
from ngswell.solve.direct import LinearSolver
from ngswell.solve.newton import Newton, Outcome
from studies.output import Findings
from studies.paper import free_swelling

# -- the variants --------------------------------------------------------------------------------------------------------


class SmoothState(State):
    """The smooth p in the momentum balance."""

    @property
    def pore_pressure(self) -> CoefficientFunction:
        return self.p


class ElementwiseState(State):
    """The charge at the point, and its gradient element by element, in the fluxes."""

    def transport(self, frame: CoefficientFunction) -> laws.Transport:
        """Fluxes with Grad cfc(J) = −cfc/(J − nS0) Grad J, Grad J = Cof F : Grad Grad u; jumps of J are missed."""
        second = self.u.Operator("hesse")  # row i: u_i,xx u_i,xy u_i,yx u_i,yy
        grad_J = CF(tuple(sum(self.cofactor[i, j] * second[i, 2 * j + k] for i in (0, 1) for j in (0, 1)) for k in (0, 1)))
        gradient, cfc = self.kinematics.flow_gradient, self.pointwise_charge
        gradients = (frame * g for g in (self.drive(self.p), gradient(self.c), -cfc / self.content * grad_J))
        return laws.transport(self.material, self.nF, self.c, cfc, *gradients)


class ElementwiseSmoothState(ElementwiseState, SmoothState):
    """Elementwise charge and smooth p: without any charge field."""


@dataclass(frozen=True)
class Variant(Concentration):
    """The paper's model with another state."""

    kind: type[State] = State

    def state(self, functions: Sequence[CoefficientFunction], setting: Setting) -> State:
        return self.kind(setting, *functions)


@dataclass(frozen=True)
class Elementwise(Variant):
    """The charge at the point in the bath condition too; the charge field is carried along, and nothing reads it."""

    def excess(self, state: State, bath: BathFields) -> dict[str, CoefficientFunction]:
        return super().excess(replace(state, cfc=state.pointwise_charge), bath)


class _FullGradient(PlaneStrain):
    """Boundary integrals are evaluated from the cells, where the whole of Grad u is known."""

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        return Norm(Cof(Id(2) + Grad(u)) * specialcf.normal(2))


class _FromCells(Problem):
    def _boundary_terms(self, *given: Any) -> list[Term]:
        return [replace(term, normal_derivatives=term.name == "efflux") for term in super()._boundary_terms(*given)]


class _SceneFromCells(Scene):
    @cached_property
    def problem(self) -> Problem:
        return _FromCells(self)


VARIANTS: dict[str, Concentration] = {
    "present": Concentration(),
    "smooth": Variant(kind=SmoothState),
    "elementwise": Elementwise(kind=ElementwiseSmoothState),
    "elementwise_pointwise": Elementwise(kind=ElementwiseState),
}


def as_variant(scene: Scene, name: str) -> Scene:
    """The scene with another discretisation; `potential` is the toolkit's default model with exact baths."""
    if name == "potential":
        return replace(scene, model=Potential(), baths=[replace(bath, treatment=None) for bath in scene.baths])
    if not name.startswith("elementwise"):
        return replace(scene, model=VARIANTS[name])
    parts = {part.name: getattr(scene, part.name) for part in fields(scene)}
    return _SceneFromCells(**parts | {"model": VARIANTS[name], "kinematics": _FullGradient()})


# -- a gel held sideways: eigenvalues and growth ---------------------------------------------------------------------------

CELL = 0.05  # mm, as in the free-swelling scene
STRETCHES = (1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 3.5, 3.75)
BATHS = (0.5, 0.3, 0.2, 0.15, 0.12, 0.1)  # mol/l
RATED = 2.75
"""The J at which the eigenvalues on all meshes are compared: the corner of the scene reaches 3, its rim 2.5."""


def held_sideways(name: str, cells: int, bath: float, held: bool = False) -> Scene:
    """cells² quadrilaterals between frictionless walls, a bath on top; `held`: the surface cannot move."""
    supports = [Roller("left|right", "x"), Roller("bottom", "y")] + [Roller("top", "xy")] * held
    size = cells * CELL
    scene = Scene(
        mesh=rectangle(size, size, cells, cells),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        supports=supports,
        baths=[Bath("top", c=bath, treatment=Penalty(40.0))],
    )
    return as_variant(scene, name)


def swell(problem: Problem, J: float, bath: float) -> NDArray:
    """F = diag(1, J), free of stress on top, ions in equilibrium with the bath; at rest if J is that of the bath."""
    m = TABLE_2
    volumetric = m.lam * (1 - m.nS0) ** 2 * (J / (1 - m.nS0) - J / (J - m.nS0))
    cfc = (1 - m.nS0) * m.cfc0 / (J - m.nS0)
    problem.initialise()
    problem.fields.components[0].Set((0 * x, (J - 1) * y))
    for name, value in (
        ("p", (m.mu * (J * J - 1) + volumetric) / J),
        ("c", donnan.cations(bath, cfc)),
        ("cfc", cfc),
    ):
        problem.vector[problem.ranges[name]] = value
    return problem.vector.copy()


def dense(matrix: Any) -> NDArray:
    """A sparse matrix of NGSolve as a full one."""
    rows, columns, values = matrix.COO()
    full = np.zeros((matrix.height, matrix.width))
    full[np.array(rows), np.array(columns)] = np.array(values)
    return full


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues, ascending, in units of µ |Grad v|², and the first mode (all coefficients of u)."""

    values: NDArray
    mode: NDArray


def undrained(problem: Problem) -> Spectrum:
    """The momentum's tangent at frozen p, c, cfc on displacements with ∫ δJ q = 0 for every discrete q."""
    space = problem.space.components[0]
    trial, test = space.TnT()
    size = dense(BilinearForm(TABLE_2.mu * InnerProduct(Grad(trial), Grad(test)) * dx).Assemble().mat)
    tangent = dense(problem.linearise())
    u = np.flatnonzero(list(problem.free))
    u = u[u < problem.ranges["u"].stop]
    _, sizes, directions = np.linalg.svd(tangent[u, problem.ranges["p"]].T)
    kernel = directions[(sizes > 1e-12 * sizes[0]).sum() :].T
    scale = np.linalg.inv(np.linalg.cholesky(kernel.T @ size[np.ix_(u, u)] @ kernel))
    values, modes = np.linalg.eigh(scale @ kernel.T @ tangent[np.ix_(u, u)] @ kernel @ scale.T)
    mode = np.zeros(space.ndof)
    mode[u] = kernel @ scale.T @ modes[:, 0]
    return Spectrum(values, mode)


def growth_rates(problem: Problem) -> NDArray:
    """Rates s [1/s] of perturbations exp(s t) of the present state: s M v = −A v, in descending order of their real part.

    A is the tangent without, M that of the contents alone: zero but for the rows of p and c, so −1/s are the eigenvalues of
    those rows of M A⁻¹. Backward Euler multiplies a perturbation by 1/(1 − s Δt) a step.
    """
    problem.dt.Set(1e30)
    stationary = dense(problem.linearise())
    problem.dt.Set(1.0)
    contents = dense(problem.linearise()) - stationary
    free = np.flatnonzero(list(problem.free))
    rows = np.r_[problem.ranges["p"], problem.ranges["c"]]
    units = (free[:, None] == rows).astype(float)
    response = np.linalg.solve(stationary[np.ix_(free, free)], units)
    rates = -1 / np.linalg.eigvals(contents[np.ix_(rows, free)] @ response)
    return rates[np.argsort(-rates.real)]


def zero_crossing(J: Sequence[float], values: Sequence[float]) -> float:
    """The first J at which the values, falling, pass zero; the last J if none does."""
    for a, b, left, right in zip(J, J[1:], values, values[1:], strict=False):
        if left > 0 >= right:
            return a + (b - a) * left / (left - right)
    return J[-1]


def bulk_stiffness(J: float, bath: float | None) -> float:
    """g″ of the energy µ/2 |F|² + g(J) [N/mm²]: the solid's and, drained to a `bath` [mol/l], −dp_D/dJ of (38)."""
    m = TABLE_2
    solid = m.mu / J**2 + m.lam * (1 - m.nS0) ** 2 / (J - m.nS0) ** 2
    if bath is None:
        return solid
    cfc = (1 - m.nS0) * m.cfc0 / (J - m.nS0)
    return solid + m.RT * cfc**2 / (2 * (J - m.nS0) * float(np.sqrt(bath**2 + cfc**2 / 4)))


def wrinkling(J: float, stiffness: float) -> float:
    """Positive where the free surface of a half-space with F = diag(1, J) stays flat (plane strain), zero where it wrinkles.

    Displacements exp(ikX + ksY) of the half-space Y < 0 of energy µ/2 |F|² + g(J), free of stress at rest, have s = 1 and
    s² = (µ + g″J²)/(µ + g″); both parts of the traction vanish where 4 J² s = (1 + J²)². The length of the wrinkles is
    free. For g″ → ∞ this is Biot's surface, J = 3.383.
    """
    s = np.sqrt((TABLE_2.mu + stiffness * J**2) / (TABLE_2.mu + stiffness))
    return float(4 * J**2 * s - (1 + J**2) ** 2)


def closed_forms() -> dict[str, float]:
    """J at which surfaces wrinkle: incompressible; at rest with its bath, drained; with the solid's bulk stiffness alone."""
    J = np.linspace(1.05, 5, 4000).tolist()
    baths = np.geomspace(0.05, 1.0, 60)[::-1]
    rest = [homogeneous_equilibrium(TABLE_2, bath, "confined").J for bath in baths]
    drained = [wrinkling(a, bulk_stiffness(a, bath)) for a, bath in zip(rest, baths, strict=True)]
    return {
        "biot_critical_J": zero_crossing(J, [wrinkling(a, 1e9) for a in J]),
        "drained_critical_J": zero_crossing(rest, drained),
        "solid_critical_J": zero_crossing(J, [wrinkling(a, bulk_stiffness(a, None)) for a in J]),
    }


# -- a disturbed state of rest ---------------------------------------------------------------------------------------------

RUN_AWAY = 0.1  # mol/l, J = 2.69: beyond what any variant holds flat
DISTURBANCE = 1e-8  # mm


def disturbed(name: str, step: float) -> tuple[NDArray, NDArray, Scene]:
    """Times [s], sideways displacement [mm] of a point of the surface, after a random disturbance of rest.

    60 steps, fewer where a cell folds before.
    """
    scene = held_sideways(name, 4, RUN_AWAY)
    problem = scene.problem
    state = swell(problem, homogeneous_equilibrium(TABLE_2, RUN_AWAY, "confined").J, RUN_AWAY)
    probe = Probe((2 * CELL, 4 * CELL), "displacement")
    # The disturbance is far below Newton's usual tolerance.
    start = with_noise(problem, Snapshot(0.0, state), DISTURBANCE)
    with suppress(StepError):
        scene.run(60 * step, Fixed(step), [probe], newton=Newton(tolerance=1e-13), resume=start)
    return probe.time, np.abs(probe.values["displacement"][:, 0]), scene


def rate(time: NDArray, size: NDArray, step: float) -> float:
    """s of the growth 1/(1 − s Δt) a step where the amplitude is between 1e-6 and 1e-4 mm; 0 if it never is."""
    clean = np.flatnonzero((size > 1e-6) & (size < 1e-4))
    if len(clean) < 3:
        return 0.0
    factor = (size[clean[-1]] / size[clean[0]]) ** (step / (time[clean[-1]] - time[clean[0]]))
    return float((1 - 1 / factor) / step)


# -- the free-swelling scene -----------------------------------------------------------------------------------------------

PATIENCE = 24


class _GivenUp(Exception):
    """More solves have failed than a run is worth."""


@dataclass(frozen=True)
class Undamped(Newton):
    """Newton's method without damping and without looking at what is admissible, as a short script has it."""

    def solve(self, problem: Problem, solver: LinearSolver) -> Outcome:
        residual, correction = (problem.fields.vec.CreateVector() for _ in range(2))
        for count in range(1, self.most_iterations + 1):
            problem.residual(residual)
            if not solver.factorise(problem.linearise()) or not solver.solve(residual, correction):
                return Outcome(count, "the linear system is singular or not finite")
            change = correction.FV().NumPy()
            problem.vector[:] -= change
            if all(np.abs(change[problem.ranges[n]]).max() <= self.tolerance * problem.references[n] for n in problem.names):
                return Outcome(count)
        return Outcome(self.most_iterations, "undamped Newton does not converge", *problem.worst(change))


@dataclass(frozen=True)
class Watched(Newton):
    """Another iteration, whose failures are kept with the time of the last accepted step."""

    method: Newton = Newton()
    clock: Area = field(default_factory=Area)
    failures: list[tuple[float, Outcome]] = field(default_factory=list)

    def solve(self, problem: Problem, solver: LinearSolver) -> Outcome:
        outcome = self.method.solve(problem, solver)
        if outcome.reason is not None:
            self.failures.append((float(self.clock.time[-1]), outcome))
            if len(self.failures) >= PATIENCE:
                raise _GivenUp
        return outcome


@dataclass(frozen=True)
class Case:
    """One run of the free-swelling scene from 7000 s: `approach` are earlier intervals (until, step) [s].

    With `noise` [mm], from the present model's state at the end of the approach, its displacement disturbed at random.
    """

    variant: str
    cells: tuple[int, int]
    step: float
    until: float = free_swelling.END
    approach: tuple[tuple[float, float], ...] = ()
    undamped: bool = False
    noise: float = 0.0

    @property
    def key(self) -> str:
        nx, ny = self.cells
        return f"{self.variant}_{nx}x{ny}_{self.step:g}s" + "_undamped" * self.undamped + "_disturbed" * bool(self.noise)

    @property
    def begin(self) -> float:
        """Start of the part that counts [s]."""
        return self.approach[-1][0] if self.approach else free_swelling.INITIAL


@dataclass(frozen=True)
class Passage:
    """How a case went; `state` is its last accepted one."""

    case: Case
    scene: Scene
    reached: float
    iterations: int
    steps: int
    failures: list[tuple[float, Outcome]]
    state: Snapshot

    @property
    def passed(self) -> bool:
        return self.reached >= self.case.until


class _Counter(Area):
    """The area at every step, the last accepted state, and the Newton iterations."""

    iterations, steps = 0, 0
    state: Snapshot

    def record(self, problem: Problem, time: float) -> None:
        super().record(problem, time)
        self.state = problem.snapshot(time)

    def observe(self, problem: Problem, report: Any) -> None:
        super().observe(problem, report)
        self.iterations, self.steps = self.iterations + report.iterations, self.steps + 1


@cache
def approached(variant: str, cells: tuple[int, int], intervals: tuple[tuple[float, float], ...]) -> Snapshot:
    """The free-swelling scene from rest at 7000 s through `intervals`."""
    scene = as_variant(free_swelling.scene(*cells), variant)
    state = scene.equilibrate(free_swelling.INITIAL)
    for until, step in intervals:
        state = scene.run(until, Fixed(step), resume=state).end
    return state


def with_noise(problem: Problem, state: Snapshot, size: float) -> Snapshot:
    """The state with a random displacement of `size` [mm] on what is free."""
    u = problem.ranges["u"]
    noise = np.zeros_like(state.values)
    noise[u] = size * np.random.default_rng(8).standard_normal(u.stop - u.start)
    noise[~np.array(list(problem.free))] = 0.0
    return Snapshot(state.time, state.values + noise)


def passage(case: Case) -> Passage:
    """Run a case as far as it goes."""
    scene = as_variant(free_swelling.scene(*case.cells), case.variant)
    state = approached("present" if case.noise else case.variant, case.cells, case.approach)
    if case.noise:
        state = with_noise(scene.problem, state, case.noise)
    counter = _Counter()
    watched = Watched(method=Undamped() if case.undamped else Newton(), clock=counter)
    with suppress(StepError, _GivenUp):
        scene.run(case.until, Fixed(case.step), [counter], newton=watched, resume=state)
    return Passage(case, scene, counter.state.time, counter.iterations, counter.steps, watched.failures, counter.state)


INTO_THE_RIM = ((7080.0, 20.0), (7200.0, 5.0))
"""Large steps to 7200 s, where the rim swells fastest."""

PAST_THE_RAMP = ((7300.0, 20.0),)
NOISE = 1e-4  # mm


def cases(quick: bool) -> list[Case]:
    """The matrix of runs."""
    if quick:
        short = [Case(name, (8, 8), 50.0) for name in ("potential", "present", "smooth")]
        return [*short, Case("elementwise", (8, 8), 50.0, 8500.0)]
    coarse = [Case(name, (11, 10), 50.0) for name in ("potential", *VARIANTS)]
    coarse += [Case("smooth", (11, 10), 50.0, undamped=True)]
    fine = [Case(name, (22, 20), 20.0) for name in ("potential", "present", "smooth")]
    fine += [Case(name, (22, 20), 20.0, 7360.0, PAST_THE_RAMP, noise=NOISE) for name in VARIANTS]
    small = [Case(name, (22, 20), 0.1, 7222.0, INTO_THE_RIM) for name in ("potential", "present", "smooth")]
    return coarse + fine + small


# -- the study -------------------------------------------------------------------------------------------------------------


def run(quick: bool = False) -> Findings:
    """Eigenvalues, growth, a disturbance, and the scene."""
    meshes = (4, 8) if quick else (4, 8, 12)
    exact = closed_forms()
    numbers: dict[str, float | int | str] = {**exact}
    rows: list[tuple[object, ...]] = []
    clock = perf_counter()

    spectra: dict[tuple[str, int], list[float]] = {}
    for name in ("present", "smooth"):
        for cells in meshes:
            problem = held_sideways(name, cells, 0.3).problem
            values = []
            for J in STRETCHES:
                swell(problem, J, 0.3)
                found = undrained(problem).values
                values.append(float(found[0]))
                rows.append(("eigenvalue", name, cells, J, values[-1], int((found < 0).sum())))
                if J == RATED:
                    numbers[f"{name}_eigenvalue_{cells}_J_{J:g}"] = values[-1]
                    numbers[f"{name}_negative_{cells}_J_{J:g}"] = rows[-1][-1]  # type: ignore[assignment]
            spectra[name, cells] = values
            numbers[f"{name}_critical_J_{cells}"] = zero_crossing(STRETCHES, values)
        control = held_sideways(name, meshes[1], 0.3, held=True).problem
        swell(control, 3.0, 0.3)
        numbers[f"{name}_held_eigenvalue_{meshes[1]}"] = float(undrained(control).values[0])

    growth: dict[str, list[float]] = {}
    at_rest = [homogeneous_equilibrium(TABLE_2, bath, "confined").J for bath in BATHS]
    for name in VARIANTS:
        for cells in meshes[:2]:
            values = []
            for bath, J in zip(BATHS, at_rest, strict=True):
                problem = held_sideways(name, cells, bath).problem
                swell(problem, J, bath)
                rates = growth_rates(problem).real
                values.append(float(rates[0]))
                rows.append(("growth", name, cells, J, values[-1], int((rates > 0).sum())))
                if bath in (0.3, RUN_AWAY):
                    numbers[f"{name}_growth_{cells}_bath_{bath:g}"] = values[-1]
                    numbers[f"{name}_growing_{cells}_bath_{bath:g}"] = rows[-1][-1]  # type: ignore[assignment]
            growth[name] = values

    courses: dict[tuple[str, str], tuple[NDArray, NDArray]] = {}
    for name in ("present", "smooth"):
        for label, step in (("ms", 1e-3), ("s", 1.0)):
            time, size, _ = disturbed(name, step)
            courses[name, label] = time / step, size
            numbers[f"{name}_disturbance_{label}"] = float(size[-1])
            rows += [("disturbance", name, label, float(t), float(a), 0) for t, a in zip(time, size, strict=True)]
            if label == "ms":
                numbers[f"{name}_measured_growth"] = rate(time, size, step)

    passages = []
    for case in cases(quick):
        print(f"convergence: {case.key}, {perf_counter() - clock:.0f} s", file=sys.stderr, flush=True)
        passages.append(passage(case))
    for done in passages:
        numbers |= account(done)
        rows.append(("run", done.case.variant, done.case.key, done.reached, done.iterations, len(done.failures)))
    numbers["runs_passed"] = sum(done.passed for done in passages)
    numbers["runs_failed"] = sum(not done.passed for done in passages)

    numbers |= {
        "mesh": ", ".join(sorted({f"{d.case.cells[0]} x {d.case.cells[1]}" for d in passages})) + " quadrilaterals, order 2",
        "steps": sum(d.steps for d in passages),
        "rejected_steps": sum(len(d.failures) for d in passages),
        "newton_iterations": sum(d.iterations for d in passages),
        "seconds": round(perf_counter() - clock, 2),
    }
    figure = draw(exact, spectra, meshes, (at_rest, growth), courses, passages)
    return Findings(figure, ("what", "variant", "size", "at", "value", "count"), rows, numbers)


def account(done: Passage) -> dict[str, float | int | str]:
    """The numbers of one run."""
    key = done.case.key
    numbers: dict[str, float | int | str] = {
        f"{key}_reached_s": done.reached,
        f"{key}_wanted_s": done.case.until,
        f"{key}_first_rejection_s": done.failures[0][0] if done.failures else -1.0,
        f"{key}_failed_solves": len(done.failures),
        f"{key}_iterations": done.iterations,
    }
    if done.failures:
        outcome = done.failures[-1][1]
        numbers |= {f"{key}_field": outcome.field, f"{key}_reason": str(outcome.reason)}
        numbers |= {f"{key}_x_mm": outcome.where[0], f"{key}_y_mm": outcome.where[1]}
    return numbers


GREY = {"present": "0.0", "smooth": "0.5", "elementwise": "0.35", "elementwise_pointwise": "0.7"}
STYLE = {4: ":", 8: "--", 12: "-"}


def draw(
    exact: dict[str, float], spectra: Any, meshes: Sequence[int], rates: Any, courses: Any, passages: Sequence[Passage]
) -> Figure:
    """Eigenvalues, growth, disturbance above; the mode, the body where a run ended, and how far runs came below."""
    figure = plt.figure(figsize=(9.6, 6.4))
    grid = figure.add_gridspec(2, 3)
    eigen, grow, disturbance, mode, ended, reached = (figure.add_subplot(grid[k // 3, k % 3]) for k in range(6))
    for (name, cells), values in spectra.items():
        eigen.plot(STRETCHES, values, STYLE[cells], color=GREY[name], lw=1.2, label=f"{name}, {cells} × {cells}")
    eigen.axhline(0, color="k", lw=0.6)
    for axes, key, text in (
        (eigen, "biot_critical_J", "incompressible"),
        (eigen, "solid_critical_J", "solid alone"),
        (grow, "drained_critical_J", "closed form"),
    ):
        axes.axvline(exact[key], color="k", lw=0.6, ls="-.")
        place = (exact[key], 0.02 if axes is grow else 0.98)
        up = "bottom" if axes is grow else "top"
        axes.annotate(
            text, place, (2, 0), ("data", "axes fraction"), "offset points", rotation=90, va=up, fontsize=6,
            bbox={"fc": "w", "ec": "none", "pad": 0.5},
        )  # fmt: skip
    eigen.set(xlabel="J, held sideways", ylabel=r"smallest eigenvalue / $\mu|\mathrm{Grad}\,v|^2$", title="without flow")
    eigen.legend(fontsize=6.5, loc="lower left")

    at_rest, growth = rates
    for (name, values), marker in zip(growth.items(), "osx+", strict=True):
        grow.plot(at_rest, values, marker=marker, ms=4, lw=0.8, color=GREY[name], label=name.replace("_", ", "))
    grow.set_yscale("symlog", linthresh=1e-3)
    grow.axhline(0, color="k", lw=0.6)
    grow.set(xlabel="J at rest, held sideways", ylabel="fastest growth [1/s]", title=f"with flow, {meshes[1]} × {meshes[1]}")
    grow.legend(fontsize=6.5, loc="center left")

    for (name, label), (steps, size) in courses.items():
        disturbance.semilogy(
            steps, size, "-" if label == "ms" else "--", color=GREY[name], label=f"{name}, 1 {label}", lw=1.2
        )
    disturbance.set(xlabel="step", ylabel=r"$|u_x|$ at the surface [mm]", title="a disturbed state of rest", ylim=(1e-12, 1))
    disturbance.legend(fontsize=7, title="time step", title_fontsize=7)

    draw_mode(mode, meshes[1])
    failed = [done for done in passages if not done.passed]
    draw_end(ended, failed[0] if failed else None)
    draw_reached(reached, passages)
    return figure


def draw_mode(axes: Axes, cells: int) -> None:
    """The gel at rest in 0.3 mol/l, moved along the first mode of the variant `smooth`."""
    problem = held_sideways("smooth", cells, 0.3).problem
    swell(problem, homogeneous_equilibrium(TABLE_2, 0.3, "confined").J, 0.3)
    found = undrained(problem)
    flat = problem.vector[problem.ranges["u"]].copy()
    problem.vector[problem.ranges["u"]] = found.mode
    largest = np.abs(problem.state.u(problem.mesh.MapToAllElements({ET.QUAD: IntegrationRule(ET.QUAD, 8)}, VOL))).max()
    problem.vector[problem.ranges["u"]] = flat + 0.3 * CELL / largest * found.mode
    picture = on_deformed_body(problem, problem.state.J, cuts=6)
    show(axes, picture, f"mode of smooth p, J = 2.10: {found.values[0]:.2f} µ")
    top = float(picture.mesh.y.max())
    axes.set(xlim=(-0.01, cells * CELL + 0.01), ylim=(top - 0.3, top + 0.02))


def draw_end(axes: Axes, done: Passage | None) -> None:
    """The body where a run ended, around the worst place; without one, the disturbed gel after steps of 1 ms."""
    if done is None:
        scene = disturbed("smooth", 1e-3)[2]
        show(axes, on_deformed_body(scene.problem, scene.problem.state.J, cuts=4), "smooth p, disturbed, 0.06 s")
        return
    done.scene.problem.restore(done.state)
    show(axes, on_deformed_body(done.scene.problem, done.scene.problem.state.J, cuts=4), f"smooth p at {done.reached:.2f} s")
    px, py = done.failures[-1][1].where
    px, py = (CF((x, y)) + done.scene.problem.state.u)(done.scene.mesh(px, py))
    axes.set(xlim=(px - 0.22, px + 0.26), ylim=(py - 0.24, py + 0.24))


def show(axes: Axes, picture: Any, title: str) -> None:
    """J on the deformed cells."""
    colours = axes.tripcolor(picture.mesh, picture.values, shading="gouraud", cmap="Greys", vmin=0.5, vmax=5)
    axes.add_collection(LineCollection(list(picture.outlines), colors="k", linewidths=0.6))
    axes.figure.colorbar(colours, ax=axes, label="J", shrink=0.8)
    axes.set(aspect="equal", title=title, xlabel="x [mm]", ylabel="y [mm]")
    axes.grid(False)


def draw_reached(axes: Axes, passages: Sequence[Passage]) -> None:
    """What share of the wanted time every run covered."""
    for place, done in enumerate(reversed(passages)):
        share = (done.reached - done.case.begin) / (done.case.until - done.case.begin)
        shade = "0.3" if not done.passed else "0.6" if done.failures else "0.85"
        axes.barh(place, share, color=shade, edgecolor="k", lw=0.4)
        nx, ny = done.case.cells
        name = done.case.variant.replace("elementwise_pointwise", "elementwise, point p")
        text = f"{name}, {nx}×{ny}, {done.case.step:g} s" + ", undamped" * done.case.undamped
        text += ", disturbed" * bool(done.case.noise)
        verdict = f": rejects at {done.failures[0][0]:.0f} s" if done.failures else ""
        verdict = verdict if done.passed else f": ends at {done.reached:.2f} s"
        axes.annotate(text + verdict, (0.02, place), va="center", fontsize=5.2, color="k" if done.passed else "w")
    axes.set(xlim=(0, 1.0), yticks=[], xlabel="share of the wanted time reached", title="free swelling")
    axes.grid(False)
