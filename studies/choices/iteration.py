"""What an iteration costs: the free-swelling block on 44 × 40 and 88 × 80 uniform cells of order 2, from rest to 7220 s.

Tolerance 1e-3, both models with their default baths, one thread. For each MODEL (`potential`, `concentration`) and MESH
(`44x40`, `88x80`; coarser with --quick), keys MODEL_MESH_...:

- `tangent_ms`, `residual_ms`, `bounds_ms`, `factorise_ms`, `solve_ms`: each alone at the state at the end, medians of turns;
- `full_iteration_ms`: all of them together: a Newton iteration with its own matrix;
- `iteration_ms`: time of the loop over Newton iterations, as it is with old matrices kept; `iterations_per_matrix`;
- `overhead`: time of the loop over (factorisations × `factorise_ms` + solves × `solve_ms`);
- `unknowns`. What a matrix and its factors take: study `growth`.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import perf_counter

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from ngsolve import SetNumThreads, TaskManager, ngsglobals
from threadpoolctl import threadpool_limits

from ngswell import Adaptive, Concentration, Potential, Progress, Result, Scene
from ngswell.solve.direct import solver_of
from studies.output import Findings, cost
from studies.paper import free_swelling
from studies.paper.free_swelling import INITIAL

UNTIL = 7220.0  # s
PARTS = ("tangent", "residual", "bounds", "factorise", "solve")


def alone(scene: Scene, turns: int) -> dict[str, float]:
    """Milliseconds of each part of an iteration at the present state, medians of `turns`."""
    problem = scene.problem
    solver = solver_of(problem)
    residual, correction = (problem.fields.vec.CreateVector() for _ in range(2))
    with TaskManager(), threadpool_limits(1, user_api="blas"):
        matrix = solver.linearise(problem)
        solver.factorise(matrix)
        problem.residual(residual)
        parts: dict[str, Callable[[], object]] = {
            "tangent": lambda: solver.linearise(problem),
            "residual": lambda: problem.residual(residual),
            "bounds": problem.inadmissible,
            "factorise": lambda: solver.factorise(matrix),
            "solve": lambda: solver.solve(residual, correction),
        }
        taken: dict[str, list[float]] = {name: [] for name in parts}
        for _ in range(turns):
            for name, part in parts.items():
                clock = perf_counter()
                part()
                taken[name].append(1e3 * (perf_counter() - clock))
    return {name: median(times) for name, times in taken.items()}


def run(quick: bool = False) -> Findings:
    """Both models, two meshes."""
    meshes = [(11, 10), (22, 20)] if quick else [(44, 40), (88, 80)]
    names = ["44x40", "88x80"]
    numbers: dict[str, float | int | str] = {}
    rows: list[tuple[object, ...]] = []
    results: list[Result] = []
    threads_before = ngsglobals.numthreads
    SetNumThreads(1)
    for name, (nx, ny) in zip(names, meshes, strict=True):
        for model in (Potential(), Concentration()):
            scene = free_swelling.remodelled(free_swelling.scene(nx, ny), model)
            rest = scene.equilibrate(INITIAL)
            label = f"{type(model).__name__.lower()}_{name}"
            result = scene.run(UNTIL, Adaptive(1e-3), [Progress(f"iteration {label}")], resume=rest)
            results.append(result)
            parts = alone(scene, 3 if quick else 7)
            linear = result.factorisations * parts["factorise"] + result.solves * parts["solve"]
            found = {
                **{f"{part}_ms": parts[part] for part in PARTS},
                "full_iteration_ms": sum(parts[part] for part in PARTS),
                "iteration_ms": 1e3 * result.seconds / result.iterations,
                "iterations_per_matrix": result.iterations / result.factorisations,
                "overhead": 1e3 * result.seconds / linear,
                "unknowns": scene.problem.space.ndof,
            }
            numbers |= {f"{label}_{key}": value for key, value in found.items()}
            rows.append((label, *found.values(), result.iterations, result.factorisations, result.solves, result.seconds))
    SetNumThreads(threads_before)
    numbers |= {"mesh": ", ".join(f"{nx} x {ny}" for nx, ny in meshes), **cost(results)}
    header = ("case", *found, "newton_iterations", "factorisations", "solves", "seconds")
    return Findings(draw(numbers, names), header, rows, numbers)


def draw(numbers: dict[str, float | int | str], names: list[str]) -> Figure:
    """Parts of an iteration with its own matrix, and the mean iteration of the run, per case."""
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.6))
    for ax, name in zip(axes, names, strict=True):
        cases = [f"{model}_{name}" for model in ("potential", "concentration")]
        bottom = [0.0] * len(cases)
        for number, part in enumerate(PARTS):
            heights = [float(numbers[f"{case}_{part}_ms"]) for case in cases]
            ax.bar(
                range(len(cases)), heights, 0.5, bottom, color=str(0.15 + 0.18 * number), edgecolor="k", lw=0.4, label=part
            )
            bottom = [low + height for low, height in zip(bottom, heights, strict=True)]
        mean = [float(numbers[f"{case}_iteration_ms"]) for case in cases]
        ax.plot(range(len(cases)), mean, "kD", mfc="w", label="mean of the run")
        ax.set_xticks(range(len(cases)), ["Potential", "Concentration"])
        ax.set(title=name.replace("x", " × "), ylabel="milliseconds an iteration", xlim=(-0.6, 1.6))
        ax.grid(False, axis="x")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", fontsize=8)
    return figure
