"""Fig. 8: a strip in equilibrium, whose bath condition takes the charge of the last step or of the present one.

The 1 × 30 strip of Table 1 starts in equilibrium with a constant bath; nothing should move. A disturbance of round-off size
(the same for both treatments) is left to itself, in steps of 10 s. Steps that fail, which those of the lagged strip may
once it moves by some micrometres, are shortened and shown. Numbers:

- `lagged_growth_per_step`: factor per step of the lagged treatment, measured where growth is clean; negative, it alternates;
- `lagged_growth_predicted`: dominant eigenvalue of the linearised one-step map;
- `lagged_growth_predicted_AxB`: the same on A × B cells, A across: the factor is a property of the mesh;
- `lagged_growth_at_S_s`, `..._predicted`: the same for time steps of S seconds: a smaller step is no cure;
- `lagged_visible_step`: first step at which node A has moved by more than 1e-6 mm;
- `lagged_first_shortened_step_s`: time [s] from which steps are shorter than 10 s (absent if none is);
- `lagged_rejected_steps`: rejected steps of the lagged strip;
- `lagged_max_mm`, `weak_max_mm`: largest displacement of node A until the same time;
- `column_factor`: the factor of a 1-d column in closed form, above −1: lagging is stable there.
"""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ngswell import TABLE_1, Fixed, InputError, Lagged, Penalty, Probe, Progress, Result, Scene
from ngswell.closed_forms.homogeneous import lagged_column_factor
from studies.output import Findings, cost, letter_panels
from studies.scenes import BATH, disturbed, strip

NODE_A = (0.0, 0.5)  # mm
STEP = 10.0  # s
GROWTH_STEPS = 26
TIME_STEPS = (0.1, 1.0, 10.0, 100.0)  # s
MESHES = ((1, 15), (1, 30), (1, 60), (2, 30), (4, 30))
"""Cells across and along on which the growth is predicted."""


@dataclass(frozen=True)
class March:
    """Times [s] and vertical displacement of node A [mm] over steps of `dt` [s], and the run."""

    dt: float
    time: NDArray
    moved: NDArray
    result: Result

    @property
    def shortened_from(self) -> float | None:
        """Time from which steps are shorter than `dt` [s]."""
        short = np.flatnonzero(np.diff(self.time) < self.dt * (1 - 1e-9))
        return float(self.time[short[0]]) if len(short) else None


@dataclass(frozen=True)
class Strips:
    """The lagged and the weak strip, and the lagged one in steps over three decades."""

    lagged_scene: Scene
    lagged: March
    weak: March
    growing: dict[float, March]


def run(quick: bool = False) -> Findings:
    """Lagged against weak, and the growth for step sizes over three decades."""
    strips = compute(30 if quick else 60)
    rows = [
        (name, STEP, float(t), float(u))
        for name, march in (("lagged", strips.lagged), ("weak", strips.weak))
        for t, u in zip(march.time, march.moved, strict=True)
    ]
    rows += [("lagged", dt, k * dt, float(u)) for dt, march in strips.growing.items() for k, u in enumerate(march.moved)]
    return Findings(draw(strips), ("treatment", "step_s", "time_s", "uy_node_A_mm"), rows, numbers(strips))


def compute(steps: int) -> Strips:
    """All runs; `steps` those of the two strips that are compared."""
    scene = strip(Lagged())
    lagged = march(scene, steps, STEP, "oscillation lagged")
    weak = march(strip(Penalty(1.0)), steps, STEP, "oscillation weak")
    growing = {dt: march(scene, GROWTH_STEPS, dt, f"oscillation lagged, {dt:g} s") for dt in TIME_STEPS}
    return Strips(scene, lagged, weak, growing)


def march(scene: Scene, steps: int, dt: float, label: str) -> March:
    """A disturbed strip over `steps` steps."""
    probe = Probe(NODE_A, "displacement")
    result = scene.run(steps * dt, Fixed(dt), [probe, Progress(label)], resume=disturbed(scene))
    return March(dt, probe.time, probe.values["displacement"][:, 1], result)


def measured_growth(displacement: NDArray) -> float:
    """Mean factor per step while the displacement is above round-off and below where the problem's nonlinearity shows."""
    clean = np.flatnonzero((np.abs(displacement) > 1e-13) & (np.abs(displacement) < 1e-7))
    if len(clean) < 3 or clean[-1] - clean[0] != len(clean) - 1:
        raise InputError("no clean growth to measure: too few steps")
    ratio = displacement[clean[-1]] / displacement[clean[0]]
    size = abs(ratio) ** (1 / (len(clean) - 1))
    return float(size * np.sign(displacement[clean[1]] / displacement[clean[0]]))


def numbers(strips: Strips) -> dict[str, float | int | str]:
    """Growth measured and predicted, and how far node A moves."""
    lagged, weak = strips.lagged.moved, strips.weak.moved
    found: dict[str, float | int | str] = {
        "lagged_growth_per_step": measured_growth(lagged),
        "lagged_growth_predicted": strips.lagged_scene.growth_factor(STEP).factor.real,
        "lagged_visible_step": int(np.flatnonzero(np.abs(lagged) > 1e-6)[0]),
        "lagged_max_mm": float(np.abs(lagged).max()),
        "weak_max_mm": float(np.abs(weak).max()),
        "column_factor": lagged_column_factor(TABLE_1, BATH),
        "lagged_rejected_steps": strips.lagged.result.rejections,
    }
    if strips.lagged.shortened_from is not None:
        found["lagged_first_shortened_step_s"] = strips.lagged.shortened_from
    for dt, march in strips.growing.items():
        found[f"lagged_growth_at_{dt:g}_s"] = measured_growth(march.moved)
        found[f"lagged_growth_at_{dt:g}_s_predicted"] = strips.lagged_scene.growth_factor(dt).factor.real
    for across, along in MESHES:
        scene = strip(Lagged(), cells=(across, along))
        found[f"lagged_growth_predicted_{across}x{along}"] = scene.growth_factor(STEP).factor.real
    runs = [strips.lagged.result, strips.weak.result, *(march.result for march in strips.growing.values())]
    return found | {"mesh": "1 x 30 quadrilaterals, order 2", "step_s": STEP, **cost(runs)}


def draw(strips: Strips) -> Figure:
    """Node A over time, lagged above weak; on the right the growth for all time steps."""
    figure = plt.figure(figsize=(8.6, 4.4))
    grid = figure.add_gridspec(2, 2, width_ratios=(1.7, 1))
    above = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=above)
    growth = figure.add_subplot(grid[:, 1])
    above.plot(strips.lagged.time, strips.lagged.moved, "k-", lw=1, marker=".", ms=3)
    above.set_title("values prescribed with the charge of the last step")
    below.plot(strips.weak.time, strips.weak.moved, "k-", lw=1)
    below.set_title("imposed weakly, $\\varepsilon = 1$")
    limit = 1.1 * float(np.abs(strips.lagged.moved).max())
    for axes in (above, below):
        axes.set(ylabel="$u_y$ of node A [mm]", ylim=(-limit, limit))
    mark_steps(above, strips.lagged)
    below.annotate(f"steps of {STEP:g} s; largest $|u_y|$: {np.abs(strips.weak.moved).max():.1e} mm", (0.02, 0.85),
                   xycoords="axes fraction", fontsize=8)  # fmt: skip
    below.set(xlabel="time [s]", xlim=(0, strips.lagged.time[-1]))
    for (dt, march), style in zip(strips.growing.items(), ("-", "--", "-.", ":"), strict=True):
        growth.semilogy(np.abs(march.moved), "k" + style, lw=1, label=f"{dt:g} s")
    growth.set(xlabel="step [-]", ylabel="$|u_y|$ of node A [mm]", xlim=(0, GROWTH_STEPS), title="growth, lagged")
    growth.legend(title="time step", loc="lower right")
    letter_panels([above, below, growth])
    return figure


def mark_steps(axes: Axes, march: March) -> None:
    """Say how long the steps are, and shade where the control of the steps has shortened them."""
    axes.annotate(f"steps of {march.dt:g} s", (0.02, 0.85), xycoords="axes fraction", fontsize=8)
    since = march.shortened_from
    if since is None:
        return
    axes.axvspan(since, march.time[-1], color="0.9", lw=0, zorder=0)
    axes.axvline(since, color="0.4", lw=0.8, ls=":")
    shortest = float(np.diff(march.time).min())
    axes.annotate(f"from {since:g} s shortened, down to {shortest:.2g} s\n({march.result.rejections} steps rejected)",
                  (since, 0.03), (-4, 0), xycoords=axes.get_xaxis_transform(), textcoords="offset points",
                  ha="right", va="bottom", fontsize=8)  # fmt: skip
