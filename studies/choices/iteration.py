"""What an iteration costs: the free-swelling block on 44 × 40 and 88 × 80 uniform cells of order 2, from rest to 7220 s.

Tolerance 1e-3, both models with their default baths, one thread. For each MODEL (`potential`, `concentration`) and MESH
(`44x40`, `88x80`; coarser with --quick), keys MODEL_MESH_...:

- `tangent_ms`, `residual_ms`, `bounds_ms`, `factorise_ms`, `solve_ms`: each alone at the state at the end, medians of turns;
- `full_iteration_ms`: all of them together: a Newton iteration with its own matrix;
- `iteration_ms`: time of the loop over Newton iterations, as it is with old matrices kept; `iterations_per_matrix`;
- `overhead`: time of the loop over (factorisations × `factorise_ms` + solves × `solve_ms`);
- `unknowns`. What a matrix and its factors take: study `growth`.

`loop_over_linear_algebra_MODEL_NX_1_thread` (NX: 44, 88) is `overhead`. With `--dolfinx PYTHON` (see `speed_error`) the same
models on the same meshes, order and quadrature in DOLFINx with generated C kernels and MUMPS, in a process of their own just
before ours: `PART_over_rival_MODEL_NX` is our time over theirs, PART one of `tangent`, `residual`, `factorise`, `solve`
and `full_iteration` (the sum of these four); `rival_MODEL_MESH_PART_ms` theirs. `quadrature_points`,
`rival_quadrature_points`: in a cell. `dolfinx`: what it is, or that it is absent. All are CPU times. Keys with `compiled_`
before them are those of scenes with `compiled=True`, which --quick leaves out.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from ngsolve import SetNumThreads, TaskManager, ngsglobals
from threadpoolctl import threadpool_limits

from ngswell import Adaptive, Concentration, Potential, Progress, Result, Scene
from ngswell.models.model import Model
from ngswell.solve.choice import solver_of
from studies.output import Findings, cost, letter_panels
from studies.rivals.turns import milliseconds
from studies.rivals.worker import ABSENT, add_dolfinx, kernels, machine, usable
from studies.scenes import INITIAL, free_swelling_block, with_model

UNTIL = 7220.0  # s
PARTS = ("tangent", "residual", "bounds", "factorise", "solve")
RIVAL_PARTS = ("tangent", "residual", "factorise", "solve")
MESHES = {"44x40": (44, 40), "88x80": (88, 80)}
QUICK_MESHES = {"44x40": (11, 10), "88x80": (22, 20)}
"""The keys stay those of the full size."""

MODELS: dict[str, Model] = {"potential": Potential(), "concentration": Concentration()}


@dataclass(frozen=True)
class IterationCost:
    """Milliseconds of each part alone, and the run in which they are taken together."""

    mesh: str
    model: str
    parts: dict[str, float]
    unknowns: int
    result: Result
    seconds: float  # CPU time of the run
    points: int  # of the quadrature in a cell
    rival: dict[str, float] | None  # DOLFINx's
    compiled: bool = False  # terms in C++

    @property
    def prefix(self) -> str:
        return "compiled_" if self.compiled else ""

    @property
    def label(self) -> str:
        return f"{self.prefix}{self.model}_{self.mesh}"

    def found(self) -> dict[str, float]:
        """Its numbers."""
        linear = self.result.factorisations * self.parts["factorise"] + self.result.solves * self.parts["solve"]
        return {
            **{f"{part}_ms": self.parts[part] for part in PARTS},
            "full_iteration_ms": sum(self.parts[part] for part in PARTS),
            "iteration_ms": 1e3 * self.seconds / self.result.iterations,
            "iterations_per_matrix": self.result.iterations / self.result.factorisations,
            "overhead": 1e3 * self.seconds / linear,
            "unknowns": self.unknowns,
        }

    def compared(self) -> dict[str, float | int]:
        """How it stands to its factorisations and solves, and to the rival."""
        case = f"{self.model}_{self.mesh.split('x')[0]}"
        found: dict[str, float | int] = {f"{self.prefix}loop_over_linear_algebra_{case}_1_thread": self.found()["overhead"]}
        if self.rival:
            theirs = {part: self.rival[f"{part}_ms"] for part in RIVAL_PARTS}
            found |= {f"rival_{self.model}_{self.mesh}_{part}_ms": theirs[part] for part in RIVAL_PARTS}
            found |= {f"{self.prefix}{part}_over_rival_{case}": self.parts[part] / theirs[part] for part in RIVAL_PARTS}
            both = (sum(times[part] for part in RIVAL_PARTS) for times in (self.parts, theirs))
            found[f"{self.prefix}full_iteration_over_rival_{case}"] = next(both) / next(both)
            found["rival_quadrature_points"] = int(self.rival["points"])
        return found


def options(parser: argparse.ArgumentParser) -> None:
    """`--dolfinx PYTHON`, which `speed_error` has as well."""
    add_dolfinx(parser)


def run(quick: bool = False, dolfinx: str | None = None) -> Findings:
    """Both models, two meshes."""
    meshes, turns = (QUICK_MESHES, 3) if quick else (MESHES, 7)
    there = usable(dolfinx)
    costs = compute(meshes, turns, dolfinx if there else None, (False,) if quick else (False, True))
    numbers: dict[str, float | int | str] = {f"{c.label}_{key}": value for c in costs for key, value in c.found().items()}
    for each in costs:
        numbers |= each.compared()
    numbers |= {"quadrature_points": costs[0].points, "dolfinx": there or ABSENT, "machine": machine()}
    numbers |= {"mesh": ", ".join(f"{nx} x {ny}" for nx, ny in meshes.values()), **cost([c.result for c in costs])}
    header = ("case", *costs[0].found(), "newton_iterations", "factorisations", "solves", "seconds")
    rows = [
        (c.label, *c.found().values(), c.result.iterations, c.result.factorisations, c.result.solves, c.result.seconds)
        for c in costs
    ]
    return Findings(draw(costs, list(meshes.values())), header, rows, numbers)


def compute(
    meshes: dict[str, tuple[int, int]], turns: int, dolfinx: str | None, compiled: Sequence[bool]
) -> list[IterationCost]:
    """Every model on every mesh, on one thread; the rival's kernels by the python `dolfinx`."""
    threads_before = ngsglobals.numthreads
    SetNumThreads(1)
    try:
        costs = []
        for mesh, cells in meshes.items():
            rivals = kernels(dolfinx, cells) if dolfinx else {}
            costs += [measure(mesh, cells, model, turns, rivals.get(model), cpp) for cpp in compiled for model in MODELS]
        return costs
    finally:
        SetNumThreads(threads_before)


def measure(
    mesh: str, cells: tuple[int, int], model: str, turns: int, rival: dict[str, float] | None = None, compiled: bool = False
) -> IterationCost:
    """One run from rest, and the parts of an iteration at its end."""
    scene = with_model(free_swelling_block(*cells, compiled=compiled), MODELS[model])
    rest = scene.equilibrate(INITIAL)
    clock = process_time()
    result = scene.run(UNTIL, Adaptive(1e-3), [Progress(f"iteration {model}_{mesh}")], resume=rest)
    seconds = process_time() - clock
    points = len(scene.problem.points) // scene.mesh.ne
    return IterationCost(
        mesh, model, alone(scene, result, turns), result.end.values.size, result, seconds, points, rival, compiled
    )


def alone(scene: Scene, result: Result, turns: int) -> dict[str, float]:
    """Milliseconds of each part of an iteration of a step from where the run ended, medians of `turns`."""
    problem, dt = scene.problem, result.steps[-1].dt
    problem.restore(result.end)
    problem.begin_step(result.end.time + dt, dt)
    solver = solver_of(problem)
    residual, correction = (problem.fields.vec.CreateVector() for _ in range(2))
    with TaskManager(), threadpool_limits(1, user_api="blas"):
        matrix = solver.linearise(problem)
        solver.factorise(matrix)
        problem.residual(residual)
        parts: dict[str, Callable[[], object]] = {
            "tangent": lambda: solver.linearise(problem),
            "residual": lambda: problem.residual(residual),
            "bounds": problem.admissible.violation,
            "factorise": lambda: solver.factorise(matrix),
            "solve": lambda: solver.solve(residual, correction),
        }
        return milliseconds(parts, turns)


FILLS = (("0.15", ""), ("0.95", ""), ("0.35", ""), ("0.6", "////"), ("0.85", "...."))
"""Shade and hatch of each part."""


def draw(costs: Sequence[IterationCost], cells: Sequence[tuple[int, int]]) -> Figure:
    """Parts of an iteration with its own matrix, and the mean iteration of the run, a panel a mesh."""
    figure, axes = plt.subplots(1, len(cells), figsize=(9.6, 3.6))
    meshes = list(dict.fromkeys(c.mesh for c in costs))
    for ax, mesh, (nx, ny) in zip(axes, meshes, cells, strict=True):
        mine = [c for c in costs if c.mesh == mesh]
        bottom = [0.0] * len(mine)
        for part, (shade, hatch) in zip(PARTS, FILLS, strict=True):
            heights = [c.parts[part] for c in mine]
            ax.bar(range(len(mine)), heights, 0.5, bottom, color=shade, hatch=hatch, edgecolor="k", lw=0.4, label=part)
            bottom = [low + height for low, height in zip(bottom, heights, strict=True)]
        ax.plot(range(len(mine)), [c.found()["iteration_ms"] for c in mine], "kD", mfc="w", label="mean of the run")
        labels = [f"{c.model.capitalize()}\n{'C++' if c.compiled else 'bytecode'}" for c in mine]
        ax.set_xticks(range(len(mine)), labels, fontsize=7)
        ax.set(title=f"{nx} × {ny} cells", ylabel="time of an iteration [ms]", xlim=(-0.6, len(mine) - 0.4))
        ax.grid(False, axis="x")
    letter_panels(axes)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside right center", fontsize=8)
    return figure
