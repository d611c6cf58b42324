"""Hard cases of ions, of time and of contrasts: families for `hard_cases`.

Each family returns its attempts, small and few if `quick`. The scenes are the confined column of Table 1 under the load that
holds its reference state, the same as a strip, and a quarter of a block of Table 2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import pi
from typing import Any

import numpy as np
from ngsolve import CF, IfPos, Mesh, x, y
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
    Newton,
    Penalty,
    PlaneStrain,
    Probe,
    Ramp,
    Result,
    Roller,
    Scene,
    Symmetry,
    Traction,
    column,
    rectangle,
)
from ngswell.baths.bath import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.closed_forms.linear_column import LinearColumn, conductance, diffusivities, penalty_efflux, potentials, storage
from ngswell.mesh.points import vertices
from ngswell.models.model import Model
from ngswell.observers.base import Observer
from ngswell.physics import donnan
from ngswell.problem.problem import Problem, Snapshot
from ngswell.stepping.schemes import BACKWARD_EULER, ESDIRK4, Scheme
from ngswell.stepping.stepper import Control
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt, attempt

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
    plane = {
        "mesh": rectangle(HEIGHT / cells, HEIGHT, 1, cells),
        "kinematics": PlaneStrain(),
        "supports": [Roller("bottom", "y"), Roller("left|right", "x")],
        "loads": [Traction("top", (0.0, -P0))],
    }
    return column_scene(model, treatment, c, cells, **{**plane, **changes})


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
    found = [abs(outputs[name](scene.mesh(*at)) / form(*at) - 1) for name, form in forms.items() for at in places]
    return float(np.max(found))


# -- bath_range ----------------------------------------------------------------------------------------------------------


def bath_range(quick: bool) -> list[Attempt]:
    """Baths from 1e-9 to 5 mol/l, changed at once or within seconds, from rest: J at the end by its closed form.

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
                        partial(distance, {"J": lambda *at, J=J: J}, 4),
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
                    f"steps of {step:g} s, ESDIRK4(3)", name, "c₊ outside", change, scheme, 20 * step, allowed(step, ESDIRK4)
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
    """For a figure: lowest share of the jump (c₊) after one step, over κ Δt/h² (κ the smaller), found and by closed form."""
    steps = np.logspace(-4, 2, 7 if quick else 25)
    found = []
    for step in steps:
        nodes = Nodes(-1e-6)
        scene = column_scene(*CHOICES["Potential"], BATH - 1e-6, CELLS)
        scene.run(step, Fixed(step), [nodes], newton=ACCURATE)
        found.append(nodes.shares("c_plus").min())
    linear = LinearColumn(TABLE_1, BATH, HEIGHT)
    kappa = diffusivities(linear.storage, linear.conductance)[0][0]
    closed = [alternating(step, "c_plus").min() for step in steps]
    return {"steps": steps, "r": kappa * steps * (CELLS / HEIGHT) ** 2, "found": np.array(found), "closed": np.array(closed)}


# -- charge --------------------------------------------------------------------------------------------------------------

UNCHARGED = replace(TABLE_1, cfc0=0.0)
CHARGED = replace(TABLE_1, cfc0=2.0)


def salt_series(places: NDArray, step: float, count: int, before: float, after: float) -> NDArray:
    """Salt [mol/l] at `places` above the sealed bottom, after `count` steps of backward Euler from a change of the bath.

    Fick's law with the ambipolar D = 2 D₊ D₋/(D₊ + D₋), whatever the porosity: modes cos(αx), α = (n + ½) π/h.
    """
    m = TABLE_1
    D = 2 * m.number("D_plus") * m.number("D_minus") / (m.number("D_plus") + m.number("D_minus"))
    n = np.arange(2000)
    wave = (n + 0.5) * pi / HEIGHT
    left = 2 * (-1.0) ** n / (wave * HEIGHT) * np.exp(-count * np.log1p(D * wave**2 * step))
    return after + (before - after) * np.cos(np.outer(places, wave)) @ left


def local_rest(charge: Callable[[float], float], bath: float, load: float, at: float) -> float:
    """J of a confined column at rest where its charge [mol/l] is charge(at)."""
    return homogeneous_equilibrium(replace(TABLE_1, cfc0=charge(at)), bath, "confined", load=load).J


def charge(quick: bool) -> list[Attempt]:
    """No charge, a charge of 2 mol/l, and charges that fall to zero along the column.

    - none: salt diffuses by Fick, nothing deforms. J − 1 is round-off. Salt against its Fourier series in the same steps,
      cubic u and quadratic salt on 20 cells: 2e-6 of the bath; a penalty of 1e4 D₊/h adds 5e-6 of the column's resistance.
    - 2 mol/l: rest by the closed form, from the loaded reference state to a bath of 0.01 mol/l at once, and unloaded with
      the charge raised. New charge comes with no cations but at the cost of anions: raised in 1e3 s, faster than salt
      diffuses in (400 s for the column, at a hundredth of the charge), they run out. 1e7 s leave nothing of the transient.
    - varying: at rest each point of a confined column obeys the closed form for its own charge. Between the nodes J is
      linear in a cell, and no better than the interpolant of the closed form: twice its error, h²/8 max |J″|, is the bound.
    """
    holding = donnan.pressure(BATH, 2.0, CHARGED.RT)
    loaded = homogeneous_equilibrium(CHARGED, 0.01, "confined", load=holding).J
    swollen = homogeneous_equilibrium(CHARGED, BATH, "confined").J
    found = []

    def strong(title: str, name: str, J: float, bath: float, **scene: Any) -> None:
        make = partial(column_scene, *CHOICES[name], bath, 10, CHARGED, **scene)
        error = partial(distance, {"J": lambda *at: J}, 4)
        found.append(attempt(title, name, make, 1e7, "J", error, 1e-8, Adaptive(1e-2), newton=ACCURATE))

    for name in CHOICES:
        found += [fick(name, measure) for measure in ("J", "c₊")]
        strong(f"2 mol/l, loaded, {BATH:g} → 0.01 mol/l at once", name, loaded, 0.01, loads=[Traction("top", (-holding,))])
        for within in (1e5,) if quick else (1e5, 1e3):
            raised = Ramp((0.0, 0.0), (within, 1.0))
            strong(f"2 mol/l, unloaded, raised in {within:g} s", name, swollen, BATH, loads=(), charge=raised)
        for end in ("bath", "bottom"):
            found += [varying(name, end, "1-d", cells) for cells in ((20,) if quick else (20, 40))]
            if name in DEFAULTS:
                found.append(varying(name, end, "2-d", 20))
    return found


def fick(name: str, measure: str) -> Attempt:
    """Salt enters an uncharged column, 0.15 → 5 mol/l at once."""
    model: Any
    model, treatment = CHOICES[name]
    places, after, count = np.array([0.01, 0.1, 0.26, 0.4]), 5.0, 20
    series = salt_series(places, 5.0, count, BATH, after)

    def error(scene: Scene, result: Result) -> float:
        output, values = ("J", 1.0) if measure == "J" else ("c_plus", series)
        field = scene.problem.state.outputs()[output]
        return float(np.abs(np.array([field(scene.mesh(at)) for at in places]) / values - 1).max())

    return attempt(
        f"no charge, {BATH:g} → {after:g} mol/l at once",
        name,
        partial(column_scene, replace(model, order=3), treatment, after, 20, UNCHARGED, loads=()),
        5.0 * count,
        measure,
        error,
        1e-12 if measure == "J" else 2e-5,
        Fixed(5.0),
        newton=ACCURATE,
    )


def varying(name: str, end: str, where: str, cells: int) -> Attempt:
    """A charge of 0.2 mol/l that falls linearly to zero at one end, in 0.05 mol/l, at rest."""
    bath, load = 0.05, 0.05
    scene_of, field, traction = (column_scene, x, (-load,)) if where == "1-d" else (strip_scene, y, (0.0, -load))

    def charge_at(at: Any) -> Any:
        return 0.2 * (1 - at / HEIGHT if end == "bath" else at / HEIGHT)

    def rest(*at: float) -> float:
        local = replace(TABLE_1, cfc0=float(charge_at(at[-1])))
        return homogeneous_equilibrium(local, bath, "confined", load=load).J

    fine = np.linspace(0.0, HEIGHT, 101)
    values = np.array([rest(at) for at in fine])
    curvature = float(np.abs(np.diff(values, 2)).max()) / (fine[1] - fine[0]) ** 2
    material = replace(TABLE_1, cfc0=charge_at(field))
    return attempt(
        f"charge falls to zero at the {end}, {where}, {cells} cells",
        name,
        partial(scene_of, *CHOICES[name], bath, cells, material=material, loads=[Traction("top", traction)]),
        1e6,
        "J",
        partial(distance, {"J": rest}, 23),
        2 * curvature * (HEIGHT / cells) ** 2 / 8 / float(values.min()),
        Adaptive(1e-2),
        newton=ACCURATE,
    )


# -- the linear column, spectrally ---------------------------------------------------------------------------------------


def legendre(degree: int) -> tuple[NDArray, NDArray]:
    """Weights and differentiation matrix of Gauss–Lobatto–Legendre interpolation on [−1, 1]."""
    series = np.polynomial.legendre.Legendre.basis(degree)
    nodes = np.concatenate([[-1.0], np.sort(series.deriv().roots().real), [1.0]])
    values = series(nodes)
    weights = 2 / (degree * (degree + 1) * values**2)
    gaps = nodes[:, None] - nodes + np.eye(degree + 1)
    slopes = values[:, None] / values / gaps
    np.fill_diagonal(slopes, 0.0)
    slopes[0, 0], slopes[-1, -1] = -degree * (degree + 1) / 4, degree * (degree + 1) / 4
    return weights, slopes


def linear_column(
    layers: Sequence[tuple[float, NDArray]], step: float, count: int, efflux: NDArray | None = None
) -> NDArray:
    """Displacement of the top [mm] after 1, 2, … `count` steps of backward Euler, per small change of the bath [mol/l].

    C ∂w/∂t = ∂(L ∂w)/∂x of `closed_forms.linear_column` on layers (thickness [mm], L), from the sealed bottom up; at the
    top w is the bath's, or −L ∂w = efflux (w − the bath's). Spectral elements of degree 12, each layer in pieces thinned by
    four towards its ends down to sqrt(κ Δt): 1e-8 against the closed form of `LinearColumn`.
    """
    C, jump = storage(TABLE_1, BATH), potentials(TABLE_1, BATH, salt=1.0)
    pieces = []
    for h, L in layers:
        reach = np.sqrt(diffusivities(C, L)[0][0] * step)
        levels = max(0, int(np.ceil(np.log(h / reach) / np.log(4))))
        thin = 0.5 * 4.0 ** np.arange(1 - levels, 1)
        shares = np.unique(np.concatenate([[0.0, 1.0], thin, 1 - thin]))
        pieces += [(h * part, L) for part in np.diff(shares)]
    weights, slopes = legendre(12)
    size = 12 * len(pieces) + 1
    storages, flows = np.zeros((size, 2, size, 2)), np.zeros((size, 2, size, 2))
    strain = np.zeros((size, 2))
    for number, (h, L) in enumerate(pieces):
        mine = slice(12 * number, 12 * number + 13)
        storages[mine, :, mine] += np.einsum("ij,kl->ikjl", np.diag(weights * h / 2), C)
        flows[mine, :, mine] += np.einsum("ij,kl->ikjl", slopes.T @ np.diag(weights) @ slopes * 2 / h, L)
        strain[mine] += np.outer(weights * h / 2, C[0])
    mass, stiff = storages.reshape(2 * size, -1) / step, flows.reshape(2 * size, -1)
    top = slice(2 * size - 2, 2 * size)
    forcing = np.zeros(2 * size)
    system = mass + stiff
    if efflux is None:
        system[top], mass[top], forcing[top] = np.eye(2 * size)[top], 0.0, jump
    else:
        system[top, top] += efflux
        forcing[top] = efflux @ jump
    w, found = np.zeros(2 * size), []
    inverse = np.linalg.inv(system)
    for _ in range(count):
        w = inverse @ (mass @ w + forcing)
        found.append(float(strain.ravel() @ w))
    return np.array(found)


SMALL = -1e-6
"""A change of the bath [mol/l] whose square, 1e-6 to 1e-5 of the response, is far below the errors of the meshes."""

COUNT = 20
"""Steps of one size in which linear columns are followed."""


def followed(
    title: str,
    name: str,
    reference: NDArray,
    step: float,
    bound: float,
    mesh: Mesh,
    material: Material = TABLE_1,
    treatment: Treatment | None = None,
) -> Attempt:
    """The top's displacement after a small change of the bath, over steps of one size, against its linear `reference`."""
    model, usual = CHOICES[name]
    top = Probe((HEIGHT,), "displacement")

    def error(scene: Scene, result: Result) -> float:
        found = top.values["displacement"].ravel()[1:] / SMALL
        return float(np.abs(found - reference).max() / np.abs(reference).max())

    make = partial(column_scene, model, treatment or usual, BATH + SMALL, 1, material, mesh=mesh)
    measure = "displacement"
    return attempt(title, name, make, step * COUNT, measure, error, bound, Fixed(step), [top], newton=ACCURATE)


def rested(title: str, name: str, until: float, material: Material, treatment: Treatment | None = None) -> Attempt:
    """J at rest in 0.0125 mol/l, changed at once: it depends on neither permeability, diffusivities nor penalty."""
    model, usual = CHOICES[name]
    J = homogeneous_equilibrium(TABLE_1, 0.0125, "confined", load=P0).J
    make = partial(column_scene, model, treatment or usual, 0.0125, 10, material)
    error = partial(distance, {"J": lambda *at: J}, 4)
    return attempt(title, name, make, until, "J at rest", error, 1e-6, Adaptive(1e-2), newton=ACCURATE)


# -- contrasts -----------------------------------------------------------------------------------------------------------

TIGHT = 1e-4
"""Permeability and diffusivities of a layer over those of the other."""

SCALED = {"K": ("K",), "D": ("D_plus", "D_minus"), "K and D": ("K", "D_plus", "D_minus")}


def layered(of: str, tight_at: str) -> tuple[Material, list[tuple[float, NDArray]]]:
    """Table 1 with half of the column tight, and the halves (thickness, conductance) from the bottom up."""
    scaled: dict[str, Any] = {name: TIGHT * TABLE_1.number(name) for name in SCALED[of]}
    tight = replace(TABLE_1, **scaled)
    lower, upper = (TABLE_1, tight) if tight_at == "bath" else (tight, TABLE_1)
    fields: dict[str, Any] = {name: IfPos(x - HEIGHT / 2, upper.number(name), lower.number(name)) for name in SCALED[of]}
    return replace(TABLE_1, **fields), [(HEIGHT / 2, conductance(m, BATH)) for m in (lower, upper)]


def both_ends(cells: int) -> Mesh:
    """Cells thinned a thousand times towards both ends, with a node in the middle."""
    return column(HEIGHT, cells, grade={"bottom": 1e3, "top": 1e3})


def contrasts(quick: bool) -> list[Attempt]:
    """Permeability and diffusivities that jump by 1e4 in the middle, or differ by decades everywhere.

    The displacement of the top after a small change of the bath, in the same time steps as `linear_column`: what is left is
    the mesh, second order in the cell. With 40 even cells it is below 3e-3 wherever the layer at the bath passes sqrt(κ Δt)
    of a cell or more. A tight skin, which steps of 5 s enter by 0.5 µm, needs cells thinner than that at the bath (`skin`);
    thinned a thousand times, 40 leave 3.4e-3. Homogeneous columns over twenty twentieths of h²/κ on 20 cells. And rest after
    a large change, which no coefficient enters: Newton's tolerance, and what the last steps leave of the slowest mode.
    """
    found = []
    for name in DEFAULTS if quick else ("Potential", "Concentration", "Concentration, Multiplier"):
        for of in ("K and D",) if quick else SCALED:
            for tight_at in ("bath", "bottom"):
                material, layers = layered(of, tight_at)
                for step in (5.0, 5e4):
                    on = both_ends(40) if tight_at == "bath" and step == 5.0 else column(HEIGHT, 40)
                    reference = linear_column(layers, step, COUNT)
                    title = f"{of} × 1e-4 at the {tight_at}, steps of {step:g} s"
                    found.append(followed(title, name, reference, step, 5e-3, on, material))
        uniform: dict[str, dict[str, Any]] = {}
        uniform |= {f"D₋/D₊ = {ratio:g}": {"D_minus": ratio * TABLE_1.number("D_plus")} for ratio in (100.0, 0.01)}
        uniform |= {f"K = {K:.3g} mm⁴/(N s)": {"K": K} for K in 1.07 * 10.0 ** np.arange(-6.0, 1.0, 3 if quick else 1)}
        for title, changed in uniform.items():
            L = conductance(replace(TABLE_1, **changed), BATH)
            step = HEIGHT**2 / diffusivities(storage(TABLE_1, BATH), L)[0][0] / COUNT
            reference = linear_column([(HEIGHT, L)], step, COUNT)
            found.append(followed(title, name, reference, step, 2e-3, column(HEIGHT, CELLS), replace(TABLE_1, **changed)))
    for name in DEFAULTS if quick else CHOICES:
        for tight_at in ("bath", "bottom"):
            material, _ = layered("K and D", tight_at)
            found.append(rested(f"K and D × 1e-4 at the {tight_at}, at rest", name, 1e9, material))
    return found


def skin(quick: bool = False) -> dict[str, NDArray]:
    """For a figure: error of the top's displacement over the cells, a tight skin at the bath in steps of 5 s."""
    material, layers = layered("K and D", "bath")
    reference = linear_column(layers, 5.0, COUNT)
    counts = np.array([10, 20, 40] if quick else [10, 20, 40, 80, 160])
    meshes: dict[str, Callable[[int], Mesh]] = {"even": partial(column, HEIGHT), "graded": both_ends}
    found = {
        kind: np.array([followed("", "Potential", reference, 5.0, np.inf, mesh(int(n)), material).error for n in counts])
        for kind, mesh in meshes.items()
    }
    return {"cells": counts, **found}


# -- penalties -----------------------------------------------------------------------------------------------------------


def penalised_efflux(model: Model, relative: float) -> NDArray:
    """Effluxes per excess of (P, Σ) of the linear column, cells of h = 1/40 mm.

    `Potential` takes ε_p for P − P̄ with P = P_linear + c̄ Σ, and ε_c for c̃ − c̄ = c̄ Σ/(2 Rθ).
    """
    cell = HEIGHT / CELLS
    if isinstance(model, Concentration):
        return penalty_efflux(TABLE_1, BATH, relative, cell)
    K, D = TABLE_1.number("K"), TABLE_1.number("D_plus")
    return relative / cell * np.array([[K, K * BATH], [0.0, D * BATH / (2 * TABLE_1.RT)]])


def penalties(quick: bool) -> list[Attempt]:
    """Penalties from 1e-6 to 1e9 in units of K/h and D₊/h.

    A penalty is a resistance in series: the top's displacement after a small change of the bath against the linear column
    with effluxes ε times the excess, in the same time steps; for ε → 0 the column, uniform, relaxes like exp(−C⁻¹G t/h)
    (`relaxed`). Steps cover the relaxation, h²/κ + h max eig(G⁻¹ C). Large ones are those of the exact treatments, to the
    order of 1/ε (`test_hard_ions`). The mesh's share, 20 cells, is 7e-4. At rest the penalty does not enter.
    """
    L = conductance(TABLE_1, BATH)
    C = storage(TABLE_1, BATH)
    found = []
    for relative in 10.0 ** np.arange(-6, 10, 3 if quick else 1):
        for name in DEFAULTS:
            G = penalised_efflux(CHOICES[name][0], relative)
            slow = HEIGHT**2 / diffusivities(C, L)[0][0] / COUNT
            slow += 4 * HEIGHT * float(np.abs(np.linalg.eigvals(np.linalg.solve(G, C))).max()) / COUNT
            treatment, title = Penalty(relative=float(relative)), f"ε = {relative:g} K/h and D₊/h"
            reference = linear_column([(HEIGHT, L)], slow, COUNT, G)
            on = column(HEIGHT, CELLS)
            found.append(followed(title, name, reference, slow, 2e-3, on, treatment=treatment))
            found.append(rested(f"{title}, at rest", name, 1e4 * slow, TABLE_1, treatment))
    return found


def relaxed(model: Model, relative: float, step: float) -> NDArray:
    """`linear_column` for a vanishing penalty: C dw/dt = −G (w − w_D)/h, w uniform."""
    C, G, target = storage(TABLE_1, BATH), penalised_efflux(model, relative), potentials(TABLE_1, BATH, salt=1.0)
    w, found = np.zeros(2), []
    for _ in range(COUNT):
        w = np.linalg.solve(C * HEIGHT / step + G, C @ w * HEIGHT / step + G @ target)
        found.append(float(HEIGHT * C[0] @ w))
    return np.array(found)


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


FAMILIES = (bath_range, charge, sudden_steps, contrasts, penalties, cycles)
