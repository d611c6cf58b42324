"""Baths that change at once, over time steps from far too small to far too large, and baths that go up and down for long."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ngswell import TABLE_1, Adaptive, Fixed, Ledger, Ramp, Result, Scene, column
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.closed_forms.linear_column import LinearColumn, diffusivities, potentials
from ngswell.mesh.points import vertices
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.stepping.schemes import BACKWARD_EULER, ESDIRK4, Scheme
from ngswell.stepping.steps import Control
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, CELLS, column_scene, distance, strip_scene
from studies.scenes import BATH, COLUMN_HEIGHT, P0

DILUTED = 0.125
"""The bath of Fig. 4 after its change [mol/l]."""


# -- sudden_steps --------------------------------------------------------------------------------------------------------

STEPS = np.logspace(-6, 6, 13)
"""Time steps [s]."""


class Nodes(Observer):
    """Shares of the bath's jump that p and c₊ have made at the nodes of the left side from the bath down, one row a step."""

    def __init__(self, change: float) -> None:
        super().__init__()
        self.after = homogeneous_equilibrium(TABLE_1, BATH + change, "confined", load=P0)
        self.rows: dict[str, list[NDArray]] = {"p": [], "c_plus": []}

    def record(self, problem: Problem, time: float) -> None:
        outputs, places = problem.state.outputs(), vertices(problem.mesh)
        left = places if problem.mesh.dim == 1 else places[places[:, 0] == 0.0]
        points = [problem.mesh(*at) for at in left[np.argsort(-left[:, -1])]]
        for name, rows in self.rows.items():
            rows.append(np.array([outputs[name](point) for point in points]))

    def shares(self, name: str) -> NDArray:
        rows = np.array(self.rows[name])
        final = self.after.p if name == "p" else self.after.c
        return (rows[1:] - rows[0]) / (final - rows[0])


def alternating(step: float, name: str, cells: int = CELLS) -> NDArray:
    """Shares of the bath's jump, small, that the first step of backward Euler on linear cells gives the nodes 0, 1, 2, …

    For each mode of the linear column (M + κ Δt K) w = 0 on the nodes off the bath, so with r = κ Δt/h²

        wᵢ = (qⁱ + q^(2n − i))/(1 + q^2n),   q + 1/q = 2 (1/3 + r)/(r − 1/6),   |q| < 1,

    symmetric about the sealed end. For r < 1/6, h² > 6 κ Δt, q is negative: the L² projection of a jump, which for r → 0
    alternates and falls by q = √3 − 2 = −0.268 from node to node. c₊ weighs the modes 0.66 and 0.34, p 2.59 and −1.59.
    """
    linear = LinearColumn(TABLE_1, BATH, COLUMN_HEIGHT)
    kappa, modes = diffusivities(linear.storage, linear.conductance)
    jump = potentials(TABLE_1, BATH, salt=1.0)
    weights = (linear.fields[name] @ modes) * (modes.T @ linear.storage @ jump) / (linear.fields[name] @ jump)
    r = kappa * step * (cells / COLUMN_HEIGHT) ** 2
    half = (1 / 3 + r) / (r - 1 / 6)
    q = half - np.sign(half) * np.sqrt((half - 1) * (half + 1))
    i = np.arange(cells + 1)[:, None]
    return ((q**i + q ** (2 * cells - i)) / (1 + q ** (2 * cells))) @ weights


def sudden_run(
    title: str, name: str, measure: str, change: float, control: Control, until: float, bound: float, **scene: Any
) -> Attempt:
    """The bath changes by `change` [mol/l] at t = 0+. `measure` is one of "first step", "c₊ outside", "J"."""
    model, treatment = CHOICES[name]
    make = partial(scene.pop("scene_of", column_scene), model, treatment, BATH + change, CELLS, **scene)
    nodes = Nodes(change)

    def error(made: Scene, result: Result) -> float:
        if measure == "J":
            return distance({"J": lambda *at: nodes.after.J}, 4, made, result)
        if measure == "c₊ outside":
            shares = nodes.shares("c_plus")
            return float(max(0.0, -shares.min(), shares.max() - 1))
        dt = result.steps[0].dt
        return max(float(np.abs(nodes.shares(of)[0] - alternating(dt, of)).max()) for of in ("p", "c_plus"))

    return attempt(title, name, make, until, measure, error, bound, control, [nodes], newton=ACCURATE)


def allowed(step: float, scheme: Scheme = BACKWARD_EULER) -> float:
    """Bound of what c₊ may leave the interval between its old and new value by, in shares of the jump."""
    overshoot = 0.0
    if scheme is not BACKWARD_EULER:
        rows = np.array([[*row, *(0.0,) * (len(scheme.rows) - len(row))] for row in scheme.rows])
        jump = np.array([0.0, *(1.0,) * (len(rows) - 1)])  # the first stage is the old state, before the jump
        z = np.logspace(-2, 6, 400)
        overshoot = max(np.linalg.solve(np.eye(len(rows)) + share * rows, share * rows @ jump)[-1] for share in z) - 1
    return 1.05 * max(0.0, -float(alternating(scheme.diagonal * step, "c_plus").min())) + overshoot + 1e-3


def sudden_steps(quick: bool) -> list[Attempt]:
    """The bath of Fig. 4 changes at t = 0+, time steps from 1e-6 to 1e6 s.

    - "first step": a change of 1e-6 mol/l; p and c₊ at the nodes against `alternating`. The solves leave 1e-8 of a
      concentration, squared in the accepted states; 1e-5 covers that and the change's own square. Not with penalties, which
      act in series with the first cell, nor Nitsche's terms, which meet the jump within it.
    - "c₊ outside": 0.15 to 0.125 mol/l, 20 steps; how far c₊ leaves the interval between old and new value, in which the
      exact solution stays (p does not: negative osmosis). Bounded by `alternating`, with 5 % of it and 1e-3 of the jump for
      κ changing with the bath. ESDIRK4(3) solves stages of a quarter of the step, and answers a jump of z = −rate Δt with
      1.0102 at most, at z = −6.8. Graded cells have h² < 6 κ Δt at the bath.
    - "J": 20 steps of 1e4 s and more, the closed form at rest; (1 + 5e-3 Δt)⁻²⁰ is below round-off.
    """
    change, fine = DILUTED - BATH, column(COLUMN_HEIGHT, CELLS, grade={"top": 30})
    found = [one for step in (STEPS[::3] if quick else STEPS) for one in in_steps_of(step, change, quick)]
    for name in DEFAULTS:
        found.append(sudden_run("adaptive", name, "J", change, Adaptive(1e-3), 1e6, 1e-8))
        title = "steps of 0.01 s, graded"
        found.append(sudden_run(title, name, "c₊ outside", change, Fixed(0.01), 0.2, 1e-3, mesh=fine))
    return found


def in_steps_of(step: float, change: float, quick: bool) -> list[Attempt]:
    """Those of `sudden_steps` that take steps of one size [s]."""
    title, until, outside, found = f"steps of {step:g} s", 20 * step, "c₊ outside", []
    for name in ("Potential", "Concentration, Multiplier"):
        found.append(sudden_run(f"first step, {step:g} s", name, "first step", -1e-6, Fixed(step), step, 1e-5))
    for name in DEFAULTS if quick else CHOICES:
        found.append(sudden_run(title, name, outside, change, Fixed(step), until, allowed(step)))
    for name in DEFAULTS:
        scheme, bound = Fixed(step, ESDIRK4), allowed(step, ESDIRK4)
        found.append(sudden_run(f"{title}, ESDIRK4(3)", name, outside, change, scheme, until, bound))
        if not quick:
            strip = {"scene_of": strip_scene}
            found.append(sudden_run(f"{title}, strip", name, outside, change, Fixed(step), until, allowed(step), **strip))
        if step >= 1e4:
            found.append(sudden_run(f"to rest, {title}", name, "J", change, Fixed(step), until, 1e-8))
    return found


def alternation(quick: bool = False) -> dict[str, NDArray]:
    """For a figure: lowest share of the jump (c₊) after one step, over κ Δt/h² (κ the smaller), found and by closed form."""
    steps = np.logspace(-4, 2, 7 if quick else 25)
    found = []
    for step in steps:
        nodes = Nodes(-1e-6)
        scene = column_scene(*CHOICES["Potential"], BATH - 1e-6, CELLS)
        scene.run(step, Fixed(step), [nodes], newton=ACCURATE)
        found.append(nodes.shares("c_plus").min())
    linear = LinearColumn(TABLE_1, BATH, COLUMN_HEIGHT)
    kappa = diffusivities(linear.storage, linear.conductance)[0][0]
    closed = [alternating(step, "c_plus").min() for step in steps]
    return {
        "steps": steps,
        "r": kappa * steps * (CELLS / COLUMN_HEIGHT) ** 2,
        "found": np.array(found),
        "closed": np.array(closed),
    }


# -- cycles --------------------------------------------------------------------------------------------------------------

HALF = 50.0
"""Half a cycle [s], two steps."""


def cycles(quick: bool) -> list[Attempt]:
    """The bath goes between 0.15 and 0.125 mol/l in cycles of 100 s, a hundred or a thousand times, in steps of 25 s.

    "repeats": fluid and cations held at the end of the last cycle against the cycle before and three quarters of the
    run: the column forgets its start like exp(−0.5) a cycle, so that after 75 nothing but round-off is left. The ledger may
    open in proportion to the steps: each leaves what Newton's method leaves, 3e-15 of what is held, and in a periodic
    state always of the same sign. Ten times that is the bound.
    """
    count = 100 if quick else 1000
    bath = Ramp(*((HALF * k, BATH if k % 2 == 0 else DILUTED) for k in range(2 * count + 1)))
    found = []
    for name in DEFAULTS:
        held = Ledger()

        def error(scene: Scene, result: Result, held: Ledger = held) -> float:
            ends = np.array([amount[:: len(result.steps) // count] for amount in (held.fluid, held.cations)])
            return float((np.abs(ends[:, [-2, 3 * count // 4]] - ends[:, [-1]]) / ends[:, [-1]]).max())

        found.append(
            attempt(
                f"{count} cycles",
                name,
                partial(column_scene, *CHOICES[name], bath, 4),
                2 * HALF * count,
                "repeats",
                error,
                1e-14,
                Fixed(HALF / 2),
                [held],
                newton=ACCURATE,
                ledger_bound=3e-14 * 4 * count,
            )
        )
    return found
