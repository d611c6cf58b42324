"""The figure: eigenvalues, growth and disturbance above; a mode, where a run ended, and how far runs came below."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from ngsolve import CF, ET, VOL, IntegrationRule, x, y

from ngswell import TABLE_2
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.plotting import Picture, on_deformed_body
from studies.limits.convergence.disturbance import Departure
from studies.limits.convergence.passages import Passage
from studies.limits.convergence.spectra import CELL, STRETCHES, Growth, Softening, held_sideways, swell, undrained
from studies.output import letter_panels

GREY = {"present": "0.0", "smooth": "0.5", "elementwise": "0.35", "elementwise_pointwise": "0.7"}
LINE = {4: ":", 8: "--", 12: "-"}


def draw(
    closed: dict[str, float],
    softenings: Sequence[Softening],
    growths: Sequence[Growth],
    departures: Sequence[Departure],
    passages: Sequence[Passage],
) -> Figure:
    """All panels."""
    figure = plt.figure(figsize=(10.4, 6.8))
    halves = figure.add_gridspec(2, 1)
    top, bottom = halves[0].subgridspec(1, 3), halves[1].subgridspec(1, 3, width_ratios=(1, 1, 1.1))
    panels = [figure.add_subplot(row[0, k]) for row in (top, bottom) for k in range(3)]
    cells = max(g.cells for g in growths)
    draw_softening(panels[0], closed, softenings)
    draw_growth(panels[1], closed, [g for g in growths if g.cells == cells])
    draw_departures(panels[2], departures)
    draw_mode(panels[3], cells)
    failed = [done for done in passages if not done.passed]
    if failed:
        draw_end(panels[4], failed[0])
    else:
        draw_disturbed(panels[4], next(d for d in departures if (d.variant, d.label) == ("smooth", "ms")))
    draw_reached(panels[5], passages)
    letter_panels(panels)
    return figure


def draw_softening(axes: Axes, closed: dict[str, float], softenings: Sequence[Softening]) -> None:
    for s in softenings:
        label = f"{s.variant}, {s.cells} × {s.cells}"
        axes.plot(STRETCHES, s.smallest, LINE[s.cells], color=GREY[s.variant], lw=1.2, label=label)
    axes.axhline(0, color="k", lw=0.6)
    axes.set(xlabel="J, held sideways", ylabel=r"smallest eigenvalue / $\mu|\mathrm{Grad}\,v|^2$", title="without flow")
    axes.set_ylim(top=1.3)
    mark(axes, closed["biot_critical_J"], "incompressible")
    mark(axes, closed["solid_critical_J"], "solid alone")
    axes.legend(fontsize=6.5, loc="lower left", frameon=True, framealpha=1.0, facecolor="w", edgecolor="none")


def draw_growth(axes: Axes, closed: dict[str, float], growths: Sequence[Growth]) -> None:
    for g, marker in zip(growths, "osx+", strict=True):
        label = g.variant.replace("_", ", ")
        axes.plot(g.J, g.fastest, marker=marker, ms=4, lw=0.8, color=GREY[g.variant], label=label)
    cells = growths[0].cells
    axes.set_yscale("symlog", linthresh=1e-3)
    axes.axhline(0, color="k", lw=0.6)
    axes.set(xlabel="J at rest, held sideways", ylabel="fastest growth [1/s]", title=f"with flow, {cells} × {cells}")
    mark(axes, closed["drained_critical_J"], "closed form")
    axes.legend(fontsize=6.5, loc="center left")


def mark(axes: Axes, J: float, text: str) -> None:
    """A closed form: a line at `J` with its name along it."""
    axes.axvline(J, color="k", lw=0.6, ls="-.")
    axes.annotate(text, (J, 0.98), (-2, 0), ("data", "axes fraction"), "offset points", rotation=90, ha="right", va="top",
                  fontsize=6.5)  # fmt: skip


def draw_departures(axes: Axes, departures: Sequence[Departure]) -> None:
    for d in departures:
        steps, line = d.time / d.step, "-" if d.label == "ms" else "--"
        axes.semilogy(steps, d.size, line, color=GREY[d.variant], label=f"{d.variant}, 1 {d.label}", lw=1.2)
    axes.set(xlabel="step", ylabel=r"$|u_x|$ at the surface [mm]", title="a disturbed state of rest", ylim=(1e-12, 1e2))
    axes.legend(fontsize=7, title="time step", title_fontsize=7, loc="upper right", ncols=2)


def draw_mode(axes: Axes, cells: int) -> None:
    """The gel at rest in 0.3 mol/l, moved along the first mode of the variant `smooth`."""
    problem = held_sideways("smooth", cells, 0.3).problem
    J = homogeneous_equilibrium(TABLE_2, 0.3, "confined").J
    swell(problem, J, 0.3)
    found = undrained(problem)
    flat = problem.vector[problem.ranges["u"]].copy()
    problem.vector[problem.ranges["u"]] = found.mode
    largest = np.abs(problem.state.u(problem.mesh.MapToAllElements({ET.QUAD: IntegrationRule(ET.QUAD, 8)}, VOL))).max()
    problem.vector[problem.ranges["u"]] = flat + 0.3 * CELL / largest * found.mode
    picture = on_deformed_body(problem.state, problem.state.J, cuts=6)
    top = float(picture.mesh.y.max())
    show(axes, picture, f"first mode of smooth p\nat J = {J:.2f}: {found.values[0]:.2f} µ".replace("-", "−"))
    axes.set(xlim=(-0.01, cells * CELL + 0.01), ylim=(top - 0.3, top + 0.02))


def draw_end(axes: Axes, done: Passage) -> None:
    """The body where a run ended, around the worst place."""
    state = done.scene.state(done.state)
    px, py = done.failures[-1][1].where
    px, py = (CF((x, y)) + state.u)(done.scene.mesh(px, py))
    picture = on_deformed_body(state, state.J, cuts=4)
    left, right, low, high = px - 0.22, px + 0.26, py - 0.24, py + 0.24
    show(axes, picture, f"smooth p, where a run ends:\n{done.reached:.2f} s")
    axes.set(xlim=(left, right), ylim=(low, high))


def draw_disturbed(axes: Axes, smooth: Departure) -> None:
    """The disturbed gel as its small steps leave it."""
    state = smooth.scene.state(smooth.end)
    picture = on_deformed_body(state, state.J, cuts=4)
    show(axes, picture, f"smooth p, disturbed:\n{smooth.time[-1]:.2f} s")


def show(axes: Axes, picture: Picture, title: str) -> None:
    """J on the deformed cells, from its least to its largest value."""
    colours = axes.tripcolor(picture.mesh, picture.values, shading="gouraud", cmap="Greys")
    axes.add_collection(LineCollection(list(picture.outlines), colors="k", linewidths=0.6))
    axes.figure.colorbar(colours, ax=axes, label="J", shrink=0.8)
    axes.set(aspect="equal", title=title, xlabel="x [mm]", ylabel="y [mm]")
    axes.grid(False)


def draw_reached(axes: Axes, passages: Sequence[Passage]) -> None:
    """What share of the wanted time every run covered."""
    for place, done in enumerate(reversed(passages)):
        shade = "0.3" if not done.passed else "0.6" if done.failures else "0.85"
        axes.barh(place, done.share, color=shade, edgecolor="k", lw=0.4)
        verdict = f"rejects at {done.failures[0][0]:.0f} s" if done.failures else ""
        verdict = verdict if done.passed else f"ends at {done.reached:.2f} s"
        axes.annotate(verdict, (0.03, place), va="center", fontsize=6, color="k" if done.passed else "w")
    axes.set_yticks(range(len(passages)), [named(done) for done in reversed(passages)], fontsize=6)
    axes.set(xlim=(0, 1.0), xlabel="share of the wanted time", title="free swelling")
    axes.grid(False)


def named(done: Passage) -> str:
    """Variant, mesh and step of a run, and what is special about it."""
    nx, ny = done.plan.cells
    variant = done.plan.variant.replace("elementwise_pointwise", "elementwise, point p")
    special = ", undamped" * done.plan.undamped + ", disturbed" * bool(done.plan.noise)
    return f"{variant}, {nx}×{ny}, {done.plan.step:g} s{special}"
