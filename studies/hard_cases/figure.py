"""The figure: outcomes and errors by family, and what stands behind four of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.hard_cases.attempt import Attempt
from studies.hard_cases.wrinkles import SurfaceHistory
from studies.output import letter_panels


def draw(attempts: dict[str, list[Attempt]], series: dict[str, Any]) -> Figure:
    """Outcomes and errors by family; below and right what stands behind four of them."""
    figure, axes = plt.subplots(2, 3, figsize=(11.0, 6.4))
    draw_outcomes(axes[0, 0], attempts)
    draw_errors(axes[0, 1], attempts)
    draw_alternation(axes[0, 2], series["alternation"])
    draw_skin(axes[1, 0], series["skin"])
    draw_corner(axes[1, 1], series["corner_errors"])
    draw_wrinkles(axes[1, 2], series["wrinkle_series"])
    letter_panels(axes.flat)
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
        ratios = [max(a.over_bound, 1e-8) for a in attempts[name] if a.outcome == "passes"]
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


def draw_wrinkles(ax: Axes, histories: Sequence[SurfaceHistory]) -> None:
    styles = ["k-", "k--", "k:"]
    *meshes, hidden, unseeded = histories
    for seeded, style in zip(meshes, styles, strict=False):
        ax.plot(seeded.x, 1e3 * (seeded.surface - seeded.surface.mean()), style, label=seeded.name)
    ax.plot(hidden.x, 1e3 * (hidden.surface - hidden.surface.mean()), color="0.55", label=hidden.name)
    ax.plot(unseeded.x, 1e3 * (unseeded.surface - unseeded.surface.mean()), color="0.55", ls="-.", label=unseeded.name)
    ax.set(title="skin that wrinkles", xlabel="x [mm]", ylabel="height of the surface [µm]")
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.5 * (high - low))
    ax.legend(fontsize=6.5, ncols=2, loc="upper center")
