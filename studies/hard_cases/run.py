"""Hard cases: each passes with its error, or ends with an exception that says why and a usable last state.

Eleven families (`ions.py`, `mechanics.py`, `wrinkles.py`), both models, and every stable treatment of
a bath where it makes a difference: `bath_range`, `charge`, `sudden_steps`, `contrasts`, `penalties`, `cycles`, `corner`,
`compression`, `swelling`, `cells`, `wrinkles`. The CSV has a row an attempt; docs/hard_cases.md says what is compared and
why each bound is what it is. An attempt is `wrong` if its error exceeds its bound, its ledger does not close, or it leaves
fields that are not finite and admissible. Numbers:

- `FAMILY_passes`, `FAMILY_stops` (StepError), `FAMILY_refused` (InputError), `FAMILY_wrong`: attempts; `wrong`: of all;
- `FAMILY_error_over_bound`, `FAMILY_imbalance`: the largest of those that pass;
- `alternation_lowest`, `alternation_above_limit`: lowest share of the jump [-] after one step, of all steps and of those
  with 6 κ Δt > h²; `alternation_difference` to the closed form;
- `skin_even`, `skin_graded`: error of a tight skin at the bath on 40 cells, relative;
- `corner_VARIANT_area`, `corner_VARIANT_arch`: errors of the area ratio [-] and of the arch [mm] on the finest mesh, and
  their `..._order` over the last refinement;
- `wrinkle_um`: amplitude of the seeded wrinkle on the finest mesh [µm], `wrinkle_change` from the next coarser one,
  relative; `wrinkle_hidden_um` with steps of 100 s, `wrinkle_unseeded_um` without a seed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from ngsolve import SetNumThreads
from tqdm import tqdm

from studies.hard_cases import ions, mechanics, wrinkles
from studies.hard_cases.attempt import Attempt
from studies.hard_cases.wrinkles import Course
from studies.output import Findings

FAMILIES: dict[str, Callable[[bool], list[Attempt]]] = {
    family.__name__: family
    for family in (
        *ions.FAMILIES,
        mechanics.corner,
        mechanics.compression,
        mechanics.swelling,
        mechanics.cells,
        wrinkles.wrinkles,
    )
}
SERIES: dict[str, Callable[[bool], Any]] = {
    "alternation": ions.alternation,
    "skin": ions.skin,
    "corner_errors": mechanics.corner_errors,
    "wrinkle_series": wrinkles.series,
}
OUTCOMES = ("passes", "stops", "refused", "wrong")
HEADER = (
    "family", "case", "variant", "outcome", "measure", "error", "bound", "imbalance", "steps", "rejected", "iterations",
    "seconds", "time_s", "message",
)  # fmt: skip


def run(quick: bool = False) -> Findings:
    """All families and series, one process a core: each alone takes one thread."""
    found: dict[str, Any] = {}
    tasks = FAMILIES | SERIES
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn"), SetNumThreads, (1,)) as pool:
        waiting = {pool.submit(task, quick): name for name, task in tasks.items()}
        with tqdm(total=len(tasks), desc="hard cases", disable=not sys.stderr.isatty(), leave=False) as bar:
            for done in as_completed(waiting):
                found[waiting[done]] = done.result()
                bar.update()
                if bar.disable:
                    print(f"hard_cases: {waiting[done]}", file=sys.stderr, flush=True)
    attempts = {name: found[name] for name in FAMILIES}
    numbers = counted(attempts) | measured(found) | {"mesh": "one a case: see the CSV and docs/hard_cases.md"}
    for key, name in (("steps", "steps"), ("rejected_steps", "rejected"), ("newton_iterations", "iterations")):
        numbers[key] = sum(getattr(a, name) for family in attempts.values() for a in family)
    numbers["seconds"] = round(sum(a.seconds for family in attempts.values() for a in family), 2)
    rows = [(family, *row(a)) for family, all_of_it in attempts.items() for a in all_of_it]
    return Findings(draw(attempts, found), HEADER, rows, numbers)


def row(a: Attempt) -> tuple[object, ...]:
    """An attempt for the table; what an attempt that did not pass has not is left empty."""
    values = (
        a.case, a.variant, a.outcome, a.measure, a.error, a.bound, a.imbalance, a.steps, a.rejected, a.iterations,
        round(a.seconds, 2), a.time, a.message,
    )  # fmt: skip
    return tuple("" if value is None else value for value in values)


def over_bound(a: Attempt) -> float:
    """Error over bound; a bound of zero is met by zero alone."""
    assert a.error is not None
    assert a.bound is not None
    return a.error / a.bound if a.bound else float(a.error > 0)


def counted(attempts: dict[str, list[Attempt]]) -> dict[str, float | int | str]:
    """How the attempts ended."""
    numbers: dict[str, float | int | str] = {}
    for name, family in attempts.items():
        for outcome in OUTCOMES:
            numbers[f"{name}_{outcome}"] = sum(a.outcome == outcome for a in family)
        passing = [a for a in family if a.outcome == "passes"]
        numbers[f"{name}_error_over_bound"] = max(map(over_bound, passing))
        numbers[f"{name}_imbalance"] = max(a.imbalance or 0.0 for a in passing)
    numbers["wrong"] = sum(a.outcome == "wrong" for family in attempts.values() for a in family)
    return numbers


def measured(found: dict[str, Any]) -> dict[str, float | int | str]:
    """The numbers of the series."""
    series, skin = found["alternation"], found["skin"]
    numbers: dict[str, float | int | str] = {
        "alternation_lowest": float(series["found"].min()),
        "alternation_above_limit": float(series["found"][series["r"] > 1 / 6].min()),
        "alternation_difference": float(np.abs(series["found"] - series["closed"]).max()),
    }
    for kind in ("even", "graded"):
        numbers[f"skin_{kind}"] = float(skin[kind][skin["cells"] == 40][0])
    by_variant: dict[str, list[tuple[Any, ...]]] = {}
    for variant, *rest in found["corner_errors"]:
        by_variant.setdefault(variant.lower().replace(",", "").replace(" ", "_"), []).append(tuple(rest))
    for variant, meshes in by_variant.items():
        for quantity, index in (("area", 1), ("arch", 4)):
            coarse, fine = (float(mesh[index]) for mesh in meshes[-2:])
            numbers[f"corner_{variant}_{quantity}"] = fine
            numbers[f"corner_{variant}_{quantity}_order"] = float(np.log2(coarse / fine))
    *refined, hidden, unseeded = (1e3 * float(course.amplitude[-1]) for course in found["wrinkle_series"])
    numbers |= {"wrinkle_um": refined[-1], "wrinkle_change": abs(refined[-2] / refined[-1] - 1)}
    return numbers | {"wrinkle_hidden_um": hidden, "wrinkle_unseeded_um": unseeded}


def draw(attempts: dict[str, list[Attempt]], found: dict[str, Any]) -> Figure:
    """Outcomes and errors by family; below and right what stands behind four of them."""
    figure, axes = plt.subplots(2, 3, figsize=(11.0, 6.4))
    draw_outcomes(axes[0, 0], attempts)
    draw_errors(axes[0, 1], attempts)
    draw_alternation(axes[0, 2], found["alternation"])
    draw_skin(axes[1, 0], found["skin"])
    draw_corner(axes[1, 1], found["corner_errors"])
    draw_wrinkles(axes[1, 2], found["wrinkle_series"])
    for ax, letter in zip(axes.flat, "abcdef", strict=True):
        title = ax.get_title()
        ax.set_title("")
        ax.set_title(f"({letter}) {title}", loc="left")
    return figure


def draw_outcomes(ax: Axes, attempts: dict[str, list[Attempt]]) -> None:
    names = list(attempts)[::-1]
    left = np.zeros(len(names))
    shades = {"passes": ("0.85", ""), "stops": ("0.45", ""), "refused": ("w", "///"), "wrong": ("k", "")}
    for outcome, (shade, hatch) in shades.items():
        counts = np.array([sum(a.outcome == outcome for a in attempts[name]) for name in names])
        if counts.any():
            ax.barh(names, counts, left=left, color=shade, edgecolor="k", lw=0.5, hatch=hatch, label=outcome)
        left += counts
    ax.set(title="how attempts end", xlabel="attempts")
    ax.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    ax.set_xlim(0, 1.05 * left.max())
    ax.legend(loc="best")
    ax.grid(axis="y", visible=False)


def draw_errors(ax: Axes, attempts: dict[str, list[Attempt]]) -> None:
    names = list(attempts)[::-1]
    for place, name in enumerate(names):
        ratios = [max(over_bound(a), 1e-8) for a in attempts[name] if a.outcome == "passes"]
        ax.plot(ratios, np.full(len(ratios), place) + np.linspace(-0.25, 0.25, len(ratios)), "k.", ms=3)
    ax.axvline(1.0, color="k", ls="--", lw=0.8)
    ax.set(xscale="log", title="error over its bound", xlabel="error / bound, none drawn at 1e-8")
    ax.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])


def draw_alternation(ax: Axes, series: dict[str, Any]) -> None:
    ax.semilogx(series["r"], series["closed"], "k-", label="closed form")
    ax.semilogx(series["r"], series["found"], "ko", mfc="w", ms=4, label="computed")
    ax.axvline(1 / 6, color="0.4", ls=":", lw=1.0)
    ax.set(title="sudden step of the bath", xlabel=r"$\kappa\,\Delta t/h^2$", ylabel="lowest share of the jump")
    ax.legend(loc="upper left")


def draw_skin(ax: Axes, series: dict[str, Any]) -> None:
    ax.loglog(series["cells"], series["even"], "ks-", mfc="w", label="even cells")
    ax.loglog(series["cells"], series["graded"], "ko-", label="graded towards both ends")
    ax.set(title="skin of 1e-4 of K and D at the bath", xlabel="cells", ylabel="relative error of the top")
    ax.set_xticks(series["cells"], [str(n) for n in series["cells"]])
    ax.minorticks_off()
    ax.legend(loc="lower left")


def draw_corner(ax: Axes, rows: Sequence[tuple[Any, ...]]) -> None:
    shown = {
        "Potential": ("k", "o"),
        "Concentration": ("0.45", "s"),
        "Potential, blended over 0.3 mm": ("k", "^"),
    }
    for name, (shade, marker) in shown.items():
        mine = [r for r in rows if r[0] == name]
        cells = [r[1] for r in mine]
        for column, line, of in ((2, "-", "area"), (5, "--", "arch")):
            ax.loglog(
                cells, [r[column] for r in mine], line, color=shade, marker=marker, mfc="w", ms=4, label=f"{name}: {of}"
            )
    ax.set(
        title="baths that jump at a corner",
        xlabel="cells a side",
        ylabel="error of area ratio; of arch [mm]",
        ylim=(1e-3, 2e-1),
    )
    ticks = sorted({r[1] for r in rows})
    ax.set_xticks(ticks, [str(n) for n in ticks])
    ax.minorticks_off()
    ax.legend(fontsize=6.5, loc="lower left", handlelength=4)


def draw_wrinkles(ax: Axes, courses: Sequence[Course]) -> None:
    styles = ["k-", "k--", "k:"]
    *meshes, hidden, unseeded = courses
    for course, style in zip(meshes, styles, strict=False):
        ax.plot(course.x, 1e3 * (course.surface - course.surface.mean()), style, label=course.name)
    ax.plot(hidden.x, 1e3 * (hidden.surface - hidden.surface.mean()), color="0.55", label=hidden.name)
    ax.plot(unseeded.x, 1e3 * (unseeded.surface - unseeded.surface.mean()), color="0.55", ls="-.", label=unseeded.name)
    ax.set(title="skin that wrinkles", xlabel="x [mm]", ylabel="height of the surface [µm]")
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.5 * (high - low))
    ax.legend(fontsize=6.5, ncols=2, loc="upper center")
