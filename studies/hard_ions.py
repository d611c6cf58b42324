"""Hard cases of ions, of time and of contrasts: families for `hard_cases`.

Each family returns its attempts, small and few if `quick`. The scenes are the confined column of Table 1 under the load that
holds its reference state, the same as a strip, and a quarter of a block of Table 2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import pi, sqrt
from typing import Any

import numpy as np
from ngsolve import CF, CoefficientFunction, IfPos, x, y
from numpy.typing import NDArray

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Bath,
    Concentration,
    Confined,
    Fixed,
    Ledger,
    Material,
    Multiplier,
    Newton,
    Penalty,
    PlaneStrain,
    Potential,
    Probe,
    Ramp,
    Result,
    Roller,
    Scene,
    Symmetry,
    Traction,
    column,
    donnan,
    rectangle,
)
from ngswell.analytic import homogeneous_equilibrium
from ngswell.baths import Treatment
from ngswell.linear import LinearColumn, conductance, diffusivities, penalty_efflux, potentials, storage
from ngswell.models import Model
from ngswell.observers import Observer
from ngswell.problem import Problem, Snapshot
from ngswell.quadrature import vertices
from ngswell.schemes import ESDIRK4
from ngswell.stepping import Control
from studies.hard import CHOICES, DEFAULTS, Attempt, attempt

HEIGHT, BATH = 0.5, 0.15  # [mm], [mol/l]
P0 = donnan.pressure(BATH, TABLE_1.cfc0, TABLE_1.RT)
"""Overall pressure of Table 1 in its bath: the load under which the reference state is at rest [N/mm²]."""

ACCURATE = Newton()
"""Nonlinear solves to 1e-8, where rest states and ledgers are compared to round-off."""


def column_scene(
    model: Model, treatment: Treatment, c: Any, cells: int, material: Material = TABLE_1, **changes: Any
) -> Scene:
    """The confined column under the bath `c`, from equilibrium with 0.15 mol/l."""
    return Scene(
        **{
            "mesh": column(HEIGHT, cells),
            "kinematics": Confined(),
            "material": material,
            "model": model,
            "supports": [Roller("bottom", "x")],
            "baths": [Bath("top", c=c, treatment=treatment)],
            "loads": [Traction("top", (-P0,))],
            "initial": (BATH, 0.0),
            **changes,
        }
    )


def strip_scene(model: Model, treatment: Treatment, c: Any, cells: int, **changes: Any) -> Scene:
    """The column as a strip of one cell across."""
    return column_scene(
        model,
        treatment,
        c,
        cells,
        mesh=rectangle(HEIGHT / cells, HEIGHT, 1, cells),
        kinematics=PlaneStrain(),
        supports=[Roller("bottom", "y"), Roller("left|right", "x")],
        loads=[Traction("top", (0.0, -P0))],
        **changes,
    )


def block_scene(model: Model, treatment: Treatment, c: Any, cells: int) -> Scene:
    """A quarter of a square of Table 2 that swells freely."""
    return Scene(
        mesh=rectangle(1.0, 1.0, cells, cells),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        model=model,
        supports=[Symmetry("left"), Symmetry("bottom")],
        baths=[Bath("top|right", c=c, treatment=treatment)],
        initial=(1.0, 0.0),
    )


def at_rest(bath: float, motion: str, load: float, scene: Scene) -> Snapshot:
    """The homogeneous state of rest in `bath` [mol/l] by its closed form: it lies in every space."""
    rest = homogeneous_equilibrium(scene.material, bath, motion, load=load)
    problem = scene.problem
    problem.initialise()
    stretch = rest.J ** (1 / problem.mesh.dim)
    values = {"p": rest.p, "c": rest.c, "cfc": rest.cfc, "P": 0.0, "salt": bath}
    for name, field in zip(problem.model.unknowns, problem.fields.components, strict=False):
        field.Set((stretch - 1) * CF((x, y)[: problem.mesh.dim]) if name == "u" else values[name])
    return problem.snapshot(scene.start)


def distance(forms: Mapping[str, Callable[..., float]], count: int, scene: Scene, result: Result) -> float:
    """Largest relative distance of outputs from closed forms, functions of the place [mm], in some points of the body."""
    corners = vertices(scene.mesh)
    low, high = corners.min(axis=0), corners.max(axis=0)
    shares = (
        np.linspace(0.01, 0.99, count)[:, None]
        if scene.mesh.dim == 1
        else np.stack([np.linspace(0.99, 0.01, count)] * 2, axis=1)
    )
    places = low + shares * (high - low)
    outputs = scene.problem.state.outputs()
    found = [abs(outputs[name](scene.mesh(*at)) / form(at) - 1) for name, form in forms.items() for at in places]
    return float(np.max(found))


# -- bath_range ----------------------------------------------------------------------------------------------------------


class Anions(Observer):
    """The lowest anion concentration over the body and the run, as a share of the largest cation concentration."""

    lowest = 1.0

    def record(self, problem: Problem, time: float) -> None:
        outputs = problem.state.outputs()
        plus, minus = (outputs[name](problem._quadrature) for name in ("c_plus", "c_minus"))
        self.lowest = min(self.lowest, float(minus.min() / plus.max()))


def bath_range(quick: bool) -> list[Attempt]:
    """Baths from 1e-9 to 5 mol/l, changed at once or within seconds, from the state of rest: J at the end by its closed form.

    The end is homogeneous, so every mesh holds it. What is left is Newton's tolerance, 1e-8, and what the last steps, long
    ones of backward Euler, leave of the slowest mode: 2e-8 at most was measured on the block, whose mode is the slower.
    """
    column_changes = [
        (BATH, 1e-9, 0.0),
        (5.0, 1e-9, 0.0),
        (5.0, 1e-9, 10.0),
        (BATH, 5.0, 0.0),
        (BATH, 5.0, 1.0),
        (1e-9, 5.0, 0.0),
    ]
    block_changes = [(1.0, 1e-9, 0.0)]
    if not quick:
        column_changes += [(BATH, 1e-6, 0.0), (BATH, 1e-3, 0.0), (BATH, 1.0, 0.0)]
        column_changes += [(BATH, 5.0, 100.0), (1e-4, 5.0, 0.0), (1e-4, 5.0, 100.0), (1e-9, 5.0, 100.0)]
        block_changes += [(1.0, 1e-9, 10.0), (1.0, 5.0, 0.0), (5.0, 1e-9, 0.0), (1e-9, 5.0, 0.0)]
    scenes = [
        ("column", partial(column_scene, cells=10), "confined", TABLE_1, P0, 3e6, column_changes),
        ("block", partial(block_scene, cells=4), "plane strain", TABLE_2, 0.0, 1e7, block_changes),
    ]
    found = []
    for body, scene_of, motion, material, load, until, changes in scenes:
        for before, after, within in changes:
            bath = Ramp((0.0, before), (within, after)) if within else after
            J = homogeneous_equilibrium(material, after, motion, load=load).J
            for name, (model, treatment) in CHOICES.items():
                found.append(
                    attempt(
                        f"{body}, {before:g} → {after:g} mol/l " + (f"in {within:g} s" if within else "at once"),
                        name,
                        partial(scene_of, model, treatment, bath),
                        until,
                        "J",
                        partial(distance, {"J": lambda at, J=J: J}, 4),
                        1e-8 if body == "column" else 1e-7,
                        Adaptive(1e-2),
                        start=partial(at_rest, before, motion, load),
                        newton=ACCURATE,
                    )
                )
    return found


# -- sudden_steps --------------------------------------------------------------------------------------------------------

DILUTED = 0.125
"""The bath of Fig. 4 after its change [mol/l]."""

STEPS = np.logspace(-6, 6, 13)
"""Time steps [s]."""

CELLS = 20
"""Of the columns of h = 1/40 mm: h²/κ is 1.2 and 0.8 s for the two modes of Table 1."""


class Nodes(Observer):
    """Shares of the bath's jump that p and c₊ have made at the nodes 0 (at the bath), 1, 2, …, one row a step."""

    def __init__(self, places: Sequence[float], change: float) -> None:
        super().__init__()
        self.places, self.after = places, homogeneous_equilibrium(TABLE_1, BATH + change, "confined", load=P0)
        self.rows: dict[str, list[NDArray]] = {"p": [], "c_plus": []}

    def record(self, problem: Problem, time: float) -> None:
        outputs = problem.state.outputs()
        points = [problem.mesh(*(0.0,) * (problem.mesh.dim - 1), at) for at in self.places]
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
    linear = LinearColumn(TABLE_1, BATH, HEIGHT)
    kappa, modes = diffusivities(linear.storage, linear.conductance)
    jump = potentials(TABLE_1, BATH, salt=1.0)
    weights = (linear.fields[name] @ modes) * (modes.T @ linear.storage @ jump) / (linear.fields[name] @ jump)
    r = kappa * step * (cells / HEIGHT) ** 2
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
    nodes = Nodes(
        np.linspace(HEIGHT, 0.0, CELLS + 1).tolist()
        if "mesh" not in scene
        else np.sort(vertices(scene["mesh"])[:, 0])[::-1].tolist(),
        change,
    )

    def error(made: Scene, result: Result) -> float:
        if measure == "J":
            return distance({"J": lambda *at: nodes.after.J}, 4, made, result)
        if measure == "c₊ outside":
            shares = nodes.shares("c_plus")
            return float(max(0.0, -shares.min(), shares.max() - 1))
        dt = result.steps[0].dt
        return max(float(np.abs(nodes.shares(of)[0] - alternating(dt, of)).max()) for of in ("p", "c_plus"))

    return attempt(title, name, make, until, measure, error, bound, control, [nodes], newton=ACCURATE)


def allowed(step: float) -> float:
    """Bound of what c₊ may leave the interval between its old and new value by, in shares of the jump."""
    return 1.05 * max(0.0, -float(alternating(step, "c_plus").min())) + 1e-3


def sudden_steps(quick: bool) -> list[Attempt]:
    """The bath of Fig. 4 changes at t = 0+, time steps from 1e-6 to 1e6 s.

    - "first step": a change of 1e-6 mol/l; p and c₊ at the nodes against `alternating`. The solves leave 1e-8 of a
      concentration, squared in the accepted states; 1e-5 covers that and the change's own square. Not with penalties, which
      act in series with the first cell, nor Nitsche's terms, which meet the jump within it.
    - "c₊ outside": 0.15 to 0.125 mol/l, 20 steps; how far c₊ leaves the interval between old and new value, in which the
      exact solution stays (p does not: negative osmosis). Bounded by `alternating`, with 5 % of it and 1e-3 of the jump for
      κ changing with the bath; ESDIRK4(3) solves stages of a quarter of the step. Graded cells have h² < 6 κ Δt at the bath.
    - "J": 20 steps of 1e4 s and more, the closed form at rest; (1 + 5e-3 Δt)⁻²⁰ is below round-off.
    """
    change = DILUTED - BATH
    strip = {"scene_of": strip_scene}
    fine = {"mesh": column(HEIGHT, CELLS, grade={"top": 30})}
    found = []
    for step in STEPS[::3] if quick else STEPS:
        for name in ("Potential", "Concentration, Multiplier"):
            found.append(sudden_run(f"first step, {step:g} s", name, "first step", -1e-6, Fixed(step), step, 1e-5))
        for name in DEFAULTS if quick else CHOICES:
            found.append(
                sudden_run(f"steps of {step:g} s", name, "c₊ outside", change, Fixed(step), 20 * step, allowed(step))
            )
        for name in DEFAULTS:
            scheme = Fixed(step, ESDIRK4)
            found.append(
                sudden_run(
                    f"steps of {step:g} s, ESDIRK4(3)", name, "c₊ outside", change, scheme, 20 * step, allowed(step / 4)
                )
            )
            if not quick:
                found.append(
                    sudden_run(
                        f"steps of {step:g} s, strip",
                        name,
                        "c₊ outside",
                        change,
                        Fixed(step),
                        20 * step,
                        allowed(step),
                        **strip,
                    )
                )
            if step >= 1e4:
                found.append(sudden_run(f"to rest, steps of {step:g} s", name, "J", change, Fixed(step), 20 * step, 1e-8))
    for name in DEFAULTS:
        found.append(sudden_run("adaptive", name, "J", change, Adaptive(1e-3), 1e6, 1e-8))
        found.append(sudden_run("steps of 0.01 s, graded", name, "c₊ outside", change, Fixed(0.01), 0.2, 1e-3, **fine))
    return found


def alternation(quick: bool = False) -> dict[str, NDArray]:
    """For a figure: lowest share of the bath's jump (c₊) after one step, over κ Δt/h² (κ the smaller), found and by closed form."""
    steps = np.logspace(-4, 2, 7 if quick else 25)
    found = []
    for step in steps:
        nodes = Nodes(np.linspace(HEIGHT, 0.0, CELLS + 1).tolist(), -1e-6)
        scene = column_scene(*CHOICES["Potential"], BATH - 1e-6, CELLS)
        scene.run(step, Fixed(step), [nodes], newton=ACCURATE)
        found.append(nodes.shares("c_plus").min())
    linear = LinearColumn(TABLE_1, BATH, HEIGHT)
    kappa = diffusivities(linear.storage, linear.conductance)[0][0]
    closed = [alternating(step, "c_plus").min() for step in steps]
    return {"steps": steps, "r": kappa * steps * (CELLS / HEIGHT) ** 2, "found": np.array(found), "closed": np.array(closed)}
