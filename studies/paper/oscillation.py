"""Fig. 8: a strip in equilibrium, whose bath condition takes the charge of the last step or of the present one.

The 1 × 30 strip of Table 1 starts in equilibrium with a constant bath; nothing should move. A disturbance of round-off size
(the same for both treatments) is left to itself. Numbers:

- `lagged_growth_per_step`: factor per step of the lagged treatment, measured where growth is clean; negative, it alternates;
- `lagged_growth_predicted`: dominant eigenvalue of the linearised one-step map;
- `lagged_growth_at_S_s`, `..._predicted`: the same for time steps of S seconds: a smaller step is no cure;
- `lagged_visible_step`: first step at which node A has moved by more than 1e-6 mm;
- `lagged_max_mm`, `weak_max_mm`: largest displacement of node A over the same number of steps;
- `column_factor`: the factor of a 1-d column in closed form, above −1: lagging is stable there.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from ngswell import (
    TABLE_1,
    Bath,
    Concentration,
    Fixed,
    InputError,
    Lagged,
    Penalty,
    PlaneStrain,
    Probe,
    Progress,
    Result,
    Roller,
    Scene,
    Traction,
    rectangle,
)
from ngswell.analysis.stability import growth_factor
from ngswell.baths.bath import Treatment
from ngswell.closed_forms.homogeneous import lagged_column_factor
from ngswell.physics import donnan
from ngswell.problem.problem import Snapshot
from studies.output import Findings, cost

BATH = 0.15  # mol/l
P0 = donnan.pressure(BATH, TABLE_1.cfc0, TABLE_1.RT)  # N/mm²
NODE_A = (0.0, 0.5)  # mm
STEP = 10.0  # s
GROWTH_STEPS = 26
DISTURBANCE = 1e-16  # of the length of the strip


def scene(treatment: Treatment) -> Scene:
    """The strip between frictionless walls, bath and equilibrium load on top."""
    return Scene(
        mesh=rectangle(0.02, 0.5, 1, 30),
        kinematics=PlaneStrain(),
        material=TABLE_1,
        model=Concentration(),
        supports=[Roller("bottom", "y"), Roller("left|right", "x")],
        baths=[Bath("top", c=BATH, treatment=treatment)],
        loads=[Traction("top", (0.0, -P0))],
    )


def disturbed(scene: Scene) -> Snapshot:
    """The initial state with noise of round-off size on the displacement."""
    problem = scene.problem
    problem.initialise()
    noise = np.zeros(problem.vector.size)
    u = problem.ranges["u"]
    noise[u] = DISTURBANCE * problem.references["u"] * np.random.default_rng(8).standard_normal(u.stop - u.start)
    noise[~np.array(list(problem.free))] = 0.0
    return Snapshot(scene.start, problem.vector + noise)


def march(scene: Scene, steps: int, dt: float, label: str) -> tuple[NDArray, NDArray, Result]:
    """Times [s] and vertical displacement of node A [mm] over `steps` steps, and the run."""
    probe = Probe(NODE_A, "displacement")
    result = scene.run(steps * dt, Fixed(dt), [probe, Progress(label)], resume=disturbed(scene))
    return probe.time, probe.values["displacement"][:, 1], result


def measured_growth(displacement: NDArray) -> float:
    """Mean factor per step while the displacement is above round-off and below where the problem's nonlinearity shows."""
    clean = np.flatnonzero((np.abs(displacement) > 1e-13) & (np.abs(displacement) < 1e-7))
    if len(clean) < 3 or clean[-1] - clean[0] != len(clean) - 1:
        raise InputError("no clean growth to measure: too few steps")
    ratio = displacement[clean[-1]] / displacement[clean[0]]
    size = abs(ratio) ** (1 / (len(clean) - 1))
    return float(size * np.sign(displacement[clean[1]] / displacement[clean[0]]))


def run(quick: bool = False) -> Findings:
    """Lagged against weak, and the growth for step sizes over three decades."""
    steps = 30 if quick else 60
    lagged_scene = scene(Lagged())
    time, lagged, lagged_run = march(lagged_scene, steps, STEP, "oscillation lagged")
    weak_time, weak, weak_run = march(scene(Penalty(1.0)), steps, STEP, "oscillation weak")
    runs = [lagged_run, weak_run]

    numbers: dict[str, float | int | str] = {
        "lagged_growth_per_step": measured_growth(lagged),
        "lagged_growth_predicted": growth_factor(lagged_scene, STEP).factor.real,
        "lagged_visible_step": int(np.flatnonzero(np.abs(lagged) > 1e-6)[0]),
        "lagged_max_mm": float(np.abs(lagged).max()),
        "weak_max_mm": float(np.abs(weak).max()),
        "column_factor": lagged_column_factor(TABLE_1, BATH),
    }
    growing: dict[float, NDArray] = {}
    for dt in (0.1, 1.0, 10.0, 100.0):
        _, growing[dt], result = march(lagged_scene, GROWTH_STEPS, dt, f"oscillation lagged, {dt:g} s")
        runs.append(result)
        numbers[f"lagged_growth_at_{dt:g}_s"] = measured_growth(growing[dt])
        numbers[f"lagged_growth_at_{dt:g}_s_predicted"] = growth_factor(lagged_scene, dt).factor.real
    numbers |= {"mesh": "1 x 30 quadrilaterals, order 2", "step_s": STEP, **cost(runs)}

    figure = plt.figure(figsize=(8.0, 4.2))
    grid = figure.add_gridspec(2, 2, width_ratios=(1.6, 1))
    above = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=above)
    growth = figure.add_subplot(grid[:, 1])
    above.plot(time, lagged, "k-", lw=1, marker=".", ms=3)
    above.set_title("values prescribed with the charge of the last step")
    below.plot(weak_time, weak, "k-", lw=1)
    below.set_title("imposed weakly, $\\varepsilon = 1$")
    limit = 1.1 * float(np.abs(lagged).max())
    for axes in (above, below):
        axes.set(ylabel="$u_y$ of node A [mm]", ylim=(-limit, limit))
    below.annotate(f"largest: {np.abs(weak).max():.1e} mm", (0.02, 0.85), xycoords="axes fraction", fontsize=8)
    below.set(xlabel="time [s]", xlim=(0, time[-1]))
    for (dt, u), style in zip(growing.items(), ("-", "--", "-.", ":"), strict=True):
        growth.semilogy(np.abs(u), "k" + style, lw=1, label=f"{dt:g} s")
    growth.set(xlabel="step", ylabel="$|u_y|$ of node A [mm]", xlim=(0, GROWTH_STEPS), title="growth, lagged")
    growth.legend(title="time step", loc="lower right")
    rows = [
        (name, STEP, float(t), float(u))
        for name, times, values in (("lagged", time, lagged), ("weak", weak_time, weak))
        for t, u in zip(times, values, strict=True)
    ]
    rows += [("lagged", dt, k * dt, float(u)) for dt, values in growing.items() for k, u in enumerate(values)]
    return Findings(figure, ("treatment", "step_s", "time_s", "uy_node_A_mm"), rows, numbers)
