"""How do time and memory of one Newton iteration grow with the size of a problem, and what solves large ones in space?

The free-swelling block (2-d, plane strain, nx × ny quadrilaterals) and an eighth of a block (3-d, n³ hexahedra), model
`Potential` of order 2 with exact baths, in a step of 10 s at the start of the dilution. Each size runs in a process of its
own, one thread. Sizes grow until the memory of the next, extrapolated, exceeds four fifths of the machine's, or its time
`LONGEST`. Exponents are fitted over the upper half of the sizes of a solver. D is 2d or 3d, N the number of unknowns; the
direct solver is that of the runs (`linear_solver`), at its largest size unless another is named:

- `largest_unknowns_D`, `two_level_largest_unknowns_D`: N of the largest size; `largest_peak_gib_D`: memory of the process;
- `exponent_tangent_time_D`, `exponent_residual_time_D`, `exponent_first_time_D` (symbolic and numeric factorisation),
  `exponent_factor_time_D` (numeric), `exponent_solve_time_D`: time grows as N to that power;
- `exponent_memory_D` (the factors), `exponent_assembly_memory_D` (matrix), `two_level_exponent_time_D` (preparing and
  solving), `two_level_exponent_memory_D`: likewise;
- `bytes_per_unknown_D_largest`: of the factors, `assembly_bytes_per_unknown_D_largest`: of the matrix;
- `tangent_seconds_D`, `residual_seconds_D`, `first_seconds_D`, `factor_seconds_D`, `solve_seconds_D`: at the largest size;
- `pardiso_over_umfpack_factor_time_D`, `..._first_time_D`, `..._solve_time_D`, `..._memory_D`: at the largest common size,
  where both exist;
- `two_level_over_direct_time_D` (numeric factorisation and `SOLVES` solves, as a matrix of fourth-order steps is kept),
  `two_level_over_direct_time_one_solve_D`, `two_level_over_direct_memory_D`: at the largest common size;
  `two_level_faster_from_D`, `two_level_faster_from_one_solve_D`: smallest N from which on the ratio of times is below one (0
  if none);
- `two_level_iterations_D`: those of a solve in a step of 10 s, at its largest size;
- `tried_unknowns_3d`: N at which steps of T = 0.01 to 100 s are tried: `two_level_iterations_3d_dt_T`,
  `two_level_seconds_3d_dt_T` (preparing and solving); `tried_direct_seconds_3d`: numeric factorisation and solve there.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from statistics import median
from time import process_time

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from ngsolve import CF, BaseVector, TaskManager, x, y, z
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from ngswell import TABLE_2, Potential, Ramp, Scene
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.problem.problem import Problem
from ngswell.solve.direct import CondensedSolver, LinearSolver
from ngswell.solve.factors import best_solver
from ngswell.solve.two_level import TwoLevelSolver
from studies.limits import cylinder
from studies.output import Findings, letter_panels
from studies.scenes import INITIAL, SIDE, WIDTH, free_swelling_block, with_model

CELLS: dict[int, tuple[int, ...]] = {2: (10, 20, 40, 80, 160, 320), 3: (4, 6, 8, 11, 14, 17, 24)}
"""Cells along the height (2-d) or each edge (3-d)."""
QUICK_CELLS: dict[int, tuple[int, ...]] = {2: (10, 20, 40), 3: (3, 4, 6)}
STEP = 10.0  # s
STEPS = (100.0, 10.0, 1.0, 0.1, 0.01)  # s, from easy to hard
TRIED = 11
"""Cells up to which steps of several sizes are tried in space."""
SOLVES = 12
"""Solves with a matrix in steps of fourth order, counted in the run of the block to 7070 s on 6³ cells, tolerance 1e-3."""
LONGEST = {"direct": 120.0, "umfpack": 20.0, "two-level": 200.0}
"""Seconds that a size may take, extrapolated."""
REPEATING = 3.0
"""Seconds for which systems are repeated, seven at most."""
SHARE = 0.8
"""Of the machine's memory that a size may take, extrapolated."""
THEORY = {2: {"time": 1.5, "memory": 1.0}, 3: {"time": 2.0, "memory": 4 / 3}}
"""Powers of N with nested dissection; in 2-d the memory's has a factor ln N."""
TIMES = ("tangent", "residual", "first", "again", "solve")


@dataclass(frozen=True)
class Trial:
    """One system by the two-level solver: step [s], iterations, seconds."""

    dt: float
    iterations: int
    seconds: float


@dataclass(frozen=True)
class Size:
    """What one size took: medians in seconds of the processor, memory in bytes."""

    dimension: int
    solver: str
    cells: int
    unknowns: int
    tangent: float
    residual: float
    first: float
    again: float
    solve: float
    assembly_bytes: int
    factor_bytes: int
    peak_bytes: int
    iterations: int
    systems: int
    seconds: float
    trials: tuple[Trial, ...] = field(default=())

    @property
    def linear(self) -> float:
        """Seconds for one linear system after the first."""
        return self.kept(1)

    def kept(self, solves: int) -> float:
        """Seconds for a matrix after the first and so many solves with it."""
        return self.again + solves * self.solve


def body(dimension: int, cells: int) -> Scene:
    """The block in plane strain, or the eighth of one in space; swollen at the start, exact baths."""
    if dimension == 3:
        return with_model(cylinder.block(cells), Potential())
    scene = free_swelling_block(round(WIDTH * cells), cells, charge=Ramp((0, 1.0)), start=INITIAL)
    return with_model(scene, Potential())


def swell(problem: Problem) -> None:
    """Put the swollen state of rest into the fields: it is homogeneous and known in closed form."""
    problem.initialise()
    plane = problem.mesh.dim == 2
    J = homogeneous_equilibrium(TABLE_2, SIDE.values[0], "plane strain" if plane else "3-d").J
    strain = J ** (1 / problem.mesh.dim) - 1
    displacement = (strain * (x - WIDTH), strain * y) if plane else (strain * x, strain * y, strain * z)
    problem.fields.components[0].Set(CF(displacement))


def make_solver(problem: Problem, name: str) -> LinearSolver:
    """The two-level solver, or the direct one of a run by its name."""
    if name == "two-level":
        return TwoLevelSolver(problem)
    return (
        LinearSolver(problem.free, name)
        if problem.condensed is None
        else CondensedSolver(problem.condensed, problem.free, name)
    )


def measure(dimension: int, cells: int, name: str, trials: bool) -> Size:
    """One size; `name` is that of a direct solver or "two-level". Runs in a process of its own, so memory is its own."""
    clock = process_time()
    problem = body(dimension, cells).problem
    taken: dict[str, list[float]] = {part: [] for part in TIMES}
    with TaskManager(), threadpool_limits(1, user_api="blas"):
        swell(problem)
        problem.begin_step(INITIAL + STEP, STEP)
        residual, correction, gap = (problem.fields.vec.CreateVector() for _ in range(3))
        solver = make_solver(problem, name)
        matrix = solver.linearise(problem)
        assembled = memory("VmRSS")
        start = process_time()
        require(solver.factorise(matrix))
        taken["first"].append(process_time() - start)
        correct(problem, solver, residual, gap, correction)
        factorised = memory("VmHWM")
        problem.vector[:] -= correction.FV().NumPy()

        problem.begin_step(INITIAL + 2 * STEP, STEP)
        systems, budget = 0, process_time() + REPEATING
        while systems == 0 or (systems < 7 and process_time() < budget):
            start = process_time()
            matrix = solver.linearise(problem)
            taken["tangent"].append(process_time() - start)
            start = process_time()
            require(solver.factorise(matrix))
            taken["again"].append(process_time() - start)
            seconds = correct(problem, solver, residual, gap, correction)
            taken["residual"].append(seconds[0])
            taken["solve"].append(seconds[1])
            systems += 1
        iterations = solver.iterations if isinstance(solver, TwoLevelSolver) else 1
        problem.vector[:] -= correction.FV().NumPy()
        tried = try_steps(problem, solver, INITIAL + 2 * STEP) if trials and isinstance(solver, TwoLevelSolver) else []
    return Size(
        dimension,
        name,
        cells,
        problem.space.ndof,
        **{part: median(values) for part, values in taken.items()},
        assembly_bytes=12 * matrix.nze + 8 * matrix.height,  # values, columns and beginnings of rows
        factor_bytes=factorised - assembled,
        peak_bytes=memory("VmHWM"),
        iterations=iterations,
        systems=systems + 1 + len(tried),
        seconds=process_time() - clock,
        trials=tuple(tried),
    )


def correct(
    problem: Problem, solver: LinearSolver, residual: BaseVector, gap: BaseVector, correction: BaseVector
) -> tuple[float, float]:
    """Newton's correction of the fields, prescribed values included; seconds for the residual and the solve."""
    start = process_time()
    problem.residual(residual)
    between = process_time()
    gap.FV().NumPy()[:] = problem.gap()
    require(solver.solve(residual, correction, gap))
    return between - start, process_time() - between


def require(done: bool) -> None:
    if not done:
        raise RuntimeError("the linear system was not solved")


def try_steps(problem: Problem, solver: TwoLevelSolver, now: float) -> list[Trial]:
    """First systems of steps of several sizes."""
    found, state = [], problem.vector.copy()
    residual, correction, gap = (problem.fields.vec.CreateVector() for _ in range(3))
    for dt in STEPS:
        problem.vector[:] = state
        problem.begin_step(now + dt, dt)
        matrix = solver.linearise(problem)
        start = process_time()
        require(solver.factorise(matrix))
        prepared = process_time() - start
        seconds = prepared + correct(problem, solver, residual, gap, correction)[1]
        found.append(Trial(dt, solver.iterations, seconds))
    return found


def memory(kind: str) -> int:
    """Bytes of this process in memory: now ("VmRSS") or at most so far ("VmHWM"). Linux only."""
    with open("/proc/self/status", encoding="ascii") as status:
        line = next(line for line in status if line.startswith(kind + ":"))
    return 1024 * int(line.split()[1])


def machine_memory() -> int:
    """Bytes of the machine's memory."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def series(dimension: int, name: str, cells: Sequence[int], longest: float) -> list[Size]:
    """Sizes one after the other, until time or memory of the next is too large."""
    done: list[Size] = []
    progress = tqdm(cells, desc=f"growth {dimension}-d {name}")
    for count in progress:
        if len(done) > 2:  # the first three are small, and two tell little on a busy machine
            unknowns = done[-1].unknowns * (count / done[-1].cells) ** dimension
            # Of two sizes, at least in proportion: small sizes grow slower than large ones will.
            seconds, peak = (
                values[1] * (unknowns / done[-1].unknowns) ** max(1.0, slope(done[-2:], values))
                for values in ([s.seconds for s in done[-2:]], [float(s.peak_bytes) for s in done[-2:]])
            )
            if seconds > longest or peak > SHARE * machine_memory():
                break
        trials = dimension == 3 and count <= TRIED
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
            done.append(process.submit(measure, dimension, count, name, trials).result())
    progress.close()
    return done


def slope(sizes: Sequence[Size], values: Sequence[float]) -> float:
    """The power of the number of unknowns with which values grow: least squares of the logarithms."""
    return float(np.polyfit(np.log([s.unknowns for s in sizes]), np.log(values), 1)[0])


def exponent(sizes: Sequence[Size], part: str) -> float:
    """`slope` of a part over the upper half of the sizes."""
    upper = sizes[len(sizes) // 2 :] if len(sizes) > 3 else sizes[-2:]
    return slope(upper, [max(float(getattr(s, part)), 1e-9) for s in upper])


COLUMNS = ("dimension", "solver", "cells", "unknowns", *TIMES, "iterations", "assembly_bytes", "factor_bytes", "peak_bytes")


def run(quick: bool = False) -> Findings:
    """All solvers in both dimensions."""
    direct = best_solver()
    grown = compute(QUICK_CELLS if quick else CELLS, direct)
    sizes = [size for by_name in grown.values() for one in by_name.values() for size in one]
    largest = {d: max(size.cells for size in sizes if size.dimension == d) for d in grown}
    found = numbers(grown, direct) | {
        "mesh": f"up to {round(WIDTH * largest[2])} x {largest[2]} quadrilaterals, {largest[3]}^3 hexahedra, order 2",
        "memory_gib": machine_memory() / 2**30,
        "steps": 0,
        "rejected_steps": 0,
        "newton_iterations": sum(size.systems for size in sizes),
        "seconds": round(sum(size.seconds for size in sizes), 2),
    }
    header = [f"{c}_s" if c in TIMES else c for c in COLUMNS]
    return Findings(draw(grown, direct), header, [[getattr(size, c) for c in COLUMNS] for size in sizes], found)


def compute(cells: dict[int, tuple[int, ...]], direct: str) -> dict[int, dict[str, list[Size]]]:
    """By dimension and solver, the sizes."""
    names = [direct, *(["umfpack"] if direct != "umfpack" else []), "two-level"]
    longest = {name: LONGEST["direct" if name == direct else name] for name in names}
    return {d: {name: series(d, name, counts, longest[name]) for name in names} for d, counts in cells.items()}


def numbers(grown: dict[int, dict[str, list[Size]]], direct: str) -> dict[str, float | int | str]:
    """Exponents, largest sizes, and the solvers against each other."""
    found: dict[str, float | int | str] = {}
    for dimension, by_name in grown.items():
        found |= of_direct(f"{dimension}d", by_name[direct])
        found |= of_two_level(f"{dimension}d", by_name["two-level"], by_name[direct])
        if direct != "umfpack":
            found |= of_umfpack(f"{dimension}d", by_name["umfpack"], by_name[direct])
    return found | of_steps(grown[3]["two-level"], grown[3][direct])


def of_direct(d: str, sizes: Sequence[Size]) -> dict[str, float | int | str]:
    """Exponents and the largest size of the direct solver."""
    last = sizes[-1]
    parts = dict(zip(("tangent", "residual", "first", "factor", "solve"), TIMES, strict=True))
    return {
        f"largest_unknowns_{d}": last.unknowns,
        f"largest_peak_gib_{d}": last.peak_bytes / 2**30,
        **{f"exponent_{key}_time_{d}": exponent(sizes, part) for key, part in parts.items()},
        f"exponent_memory_{d}": exponent(sizes, "factor_bytes"),
        f"exponent_assembly_memory_{d}": exponent(sizes, "assembly_bytes"),
        f"bytes_per_unknown_{d}_largest": last.factor_bytes / last.unknowns,
        f"assembly_bytes_per_unknown_{d}_largest": last.assembly_bytes / last.unknowns,
        **{f"{key}_seconds_{d}": float(getattr(last, part)) for key, part in parts.items()},
    }


def common(one: Sequence[Size], other: Sequence[Size]) -> list[tuple[Size, Size]]:
    """Pairs of equal size."""
    by_cells = {size.cells: size for size in other}
    return [(size, by_cells[size.cells]) for size in one if size.cells in by_cells]


def of_two_level(d: str, sizes: Sequence[Size], direct: Sequence[Size]) -> dict[str, float | int | str]:
    """The iterative solver against the direct one."""
    pairs = common(sizes, direct)
    mine, other = pairs[-1]
    found: dict[str, float | int | str] = {
        f"two_level_largest_unknowns_{d}": sizes[-1].unknowns,
        f"two_level_iterations_{d}": sizes[-1].iterations,
        f"two_level_exponent_time_{d}": exponent(sizes, "linear"),
        f"two_level_exponent_memory_{d}": exponent(sizes, "factor_bytes"),
        f"two_level_over_direct_memory_{d}": mine.factor_bytes / other.factor_bytes,
    }
    for solves, which in ((SOLVES, d), (1, f"one_solve_{d}")):
        faster = 0
        for two, one in reversed(pairs):
            if two.kept(solves) >= one.kept(solves):
                break
            faster = two.unknowns
        found[f"two_level_over_direct_time_{which}"] = mine.kept(solves) / other.kept(solves)
        found[f"two_level_faster_from_{which}"] = faster
    return found


def of_umfpack(d: str, sizes: Sequence[Size], pardiso: Sequence[Size]) -> dict[str, float | int | str]:
    """Pardiso against UMFPACK."""
    theirs, mine = common(sizes, pardiso)[-1]
    return {
        f"umfpack_largest_unknowns_{d}": theirs.unknowns,
        f"pardiso_over_umfpack_first_time_{d}": mine.first / theirs.first,
        f"pardiso_over_umfpack_factor_time_{d}": mine.again / theirs.again,
        f"pardiso_over_umfpack_solve_time_{d}": mine.solve / theirs.solve,
        f"pardiso_over_umfpack_memory_{d}": mine.factor_bytes / theirs.factor_bytes,
    }


def of_steps(two_level: Sequence[Size], direct: Sequence[Size]) -> dict[str, float | int | str]:
    """Steps of several sizes, at the largest size that tried them."""
    two, one = [pair for pair in common(two_level, direct) if pair[0].trials][-1]
    numbers: dict[str, float | int | str] = {
        "tried_unknowns_3d": two.unknowns,
        "tried_direct_seconds_3d": one.linear,
    }
    for trial in two.trials:
        numbers[f"two_level_iterations_3d_dt_{trial.dt:g}"] = trial.iterations
        numbers[f"two_level_seconds_3d_dt_{trial.dt:g}"] = trial.seconds
    return numbers


def draw(grown: dict[int, dict[str, list[Size]]], direct: str) -> Figure:
    """A row a dimension: seconds of each part on the left, bytes per unknown on the right."""
    figure, axes = plt.subplots(2, 2, figsize=(9.6, 7.2), width_ratios=(1.5, 1))
    for row, (dimension, by_name) in zip(axes, grown.items(), strict=True):
        for ax in row:
            ax.set(xscale="log", yscale="log", xlabel="unknowns N [-]")
        draw_times(row[0], dimension, by_name, direct)
        draw_memory(row[1], dimension, by_name, direct)
        for ax in row:
            ax.set_title(f"{dimension}-d, {'time of an iteration' if ax is row[0] else 'memory'}")
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_minor_formatter(NullFormatter())
    letter_panels(axes.flat)
    return figure


NAMES = {"pardiso": "Pardiso", "umfpack": "UMFPACK", "two-level": "two-level"}


def draw_times(ax: Axes, dimension: int, by_name: dict[str, list[Size]], direct: str) -> None:
    """Seconds of each part over unknowns; thin lines grow as theory says."""
    sizes = by_name[direct]
    unknowns = [s.unknowns for s in sizes]
    styles = {"tangent": ("s-", "0.55"), "residual": ("d-", "0.75"), "first": ("^--", "0.0"), "again": ("o-", "0.0")}
    labels = {
        "tangent": "tangent",
        "residual": "residual",
        "first": f"{NAMES[direct]}, first factorisation",
        "again": f"{NAMES[direct]}, numeric",
        "solve": f"{NAMES[direct]}, solve",
    }
    for part in TIMES:
        style, colour = styles.get(part, ("v:", "0.0"))
        ax.plot(unknowns, [getattr(s, part) for s in sizes], style, color=colour, ms=4, lw=1.1, label=labels[part])
    for name, style, colour in (("umfpack", "x-.", "0.4"), ("two-level", "P-", "0.4")):
        if name in by_name and name != direct:
            what = "numeric" if name == "umfpack" else "prepare and solve"
            values = [s.again if name == "umfpack" else s.linear for s in by_name[name]]
            where = [s.unknowns for s in by_name[name]]
            ax.plot(where, values, style, color=colour, mfc="w", ms=6, lw=1.8, label=f"{NAMES[name]}, {what}")
    last = sizes[-1]
    for value, power, side in ((2.5 * last.first, THEORY[dimension]["time"], "right"), (0.5 * last.residual, 1.0, "left")):
        draw_slope(ax, last.unknowns, value, power, "N" if power == 1 else f"N^{{{power:g}}}", side)
    ax.set_ylabel("time [s]")
    ax.legend(fontsize=7, loc="upper left")


def draw_memory(ax: Axes, dimension: int, by_name: dict[str, list[Size]], direct: str) -> None:
    """Bytes per unknown of the factors and of the matrix."""
    styles = {direct: "o-", "umfpack": "x-.", "two-level": "P-"}
    colours = {"umfpack": "0.4", "two-level": "0.4"}
    for name, sizes in by_name.items():
        if name == direct or name in colours:
            colour, fill = ("k", "k") if name == direct else (colours[name], "w")
            values = [s.factor_bytes / s.unknowns / 1024 for s in sizes]
            ax.plot(
                [s.unknowns for s in sizes], values, styles[name], color=colour, mfc=fill, ms=5, lw=1.4, label=NAMES[name]
            )
    matrix = by_name[direct]
    values = [s.assembly_bytes / s.unknowns / 1024 for s in matrix]
    ax.plot([s.unknowns for s in matrix], values, "s-", color="0.55", ms=4, lw=1.1, label="matrix")
    last = matrix[-1]
    per_unknown = last.factor_bytes / last.unknowns / 1024
    if dimension == 3:
        draw_slope(ax, last.unknowns, 1.6 * per_unknown, THEORY[3]["memory"] - 1, "N^{1/3}", "right")
    else:
        span = last.unknowns * np.geomspace(1 / 20, 1)
        ax.plot(span, 1.6 * per_unknown * np.log(span) / np.log(last.unknowns), "-", color="0.3", lw=0.6)
        ax.annotate(r"$\ln N$", (span[0], 1.4 * per_unknown), fontsize=8, ha="center", va="bottom")
    ax.set(ylabel="memory per unknown [KiB]", ylim=(0.4, None))
    ax.legend(fontsize=7)


def draw_slope(ax: Axes, unknowns: float, value: float, power: float, text: str, side: str) -> None:
    """A thin line of slope `power` down from (unknowns, value) over a factor of 20, named at its lower end."""
    span = np.array([unknowns / 20, unknowns])
    ax.plot(span, value * (span / unknowns) ** power, "-", color="0.3", lw=0.6)
    place = (span[0] * (0.9 if side == "right" else 1.1), value * 20**-power)
    ax.annotate(f"${text}$", place, fontsize=8, ha=side, va="center" if side == "right" else "top")
