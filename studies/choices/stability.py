"""Where lagged baths are stable: growth per step over the gel's stiffness and charge, for each remedy that the paper lists.

Two bodies in 0.15 mol/l, Table 1 otherwise, steps of 10 s: the strip of Fig. 8, at rest in its reference configuration under
the load p0; and a quarter of a block, the bath on its two free sides, at rest homogeneously swollen (closed form; `Frozen`
in the equilibrium of its own charge). Growth is the dominant eigenvalue of the linearised one-step map. Treatments:
`lagged`, `inner_layer`, `averaged`, `least_squares` (degree 0), `frozen`. Numbers, BODY being strip or block:

- `BODY_TREATMENT_safe_share`: share of the map's points where |growth| < 1 (of those that have a state at rest);
- `BODY_TREATMENT_safe_mu_at_C`: stiffness µ [N/mm²] above which |growth| < 1 at the charge C mol/l, by bisection; the
  smallest µ of the map where nothing grows (the block with `frozen`: above which it has a state at rest);
- `column_safe_mu_at_C`: the same of a 1-d column, closed form, whatever the step;
- `load_safe_mu_at_C`: µ below which the strip itself buckles under the dead load p0, whatever the treatment. Where the true
  growth outruns the step, backward Euler damps it: |growth| < 1 is no proof there;
- `strip_TREATMENT_growth_N_across`: growth of Table 1's strip, N cells across (each as in Fig. 8 along);
- `block_TREATMENT_growth_N_a_side`: growth of a soft block (µ = 0.06), N × N cells;
- `BODY_TREATMENT_growth_at_S_s`: growth of both bodies with µ = 0.06 in steps of S seconds;
- `BODY_TREATMENT_measured`, `..._predicted`: growth in runs from 1e-10 mm of the mode against the map;
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from ngsolve import CF, Parameter, x, y
from numpy.typing import NDArray
from tqdm import tqdm

from ngswell import (
    TABLE_1,
    Averaged,
    Concentration,
    Fixed,
    Frozen,
    InnerLayer,
    InputError,
    Lagged,
    LeastSquares,
    Material,
    Probe,
    Result,
    Scene,
    Traction,
)
from ngswell.baths.treatment import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium, lagged_column_factor
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
from studies.output import Findings, cost, letter_panels
from studies.paper.oscillation import measured_growth
from studies.scenes import BATH, quarter_block, rest_load
from studies.scenes import strip as strip_of_table_1

STEP = 10.0  # s
SOFT = 0.06  # N/mm², where the column grows, too
TREATMENTS: dict[str, Treatment] = {
    "lagged": Lagged(),
    "inner_layer": Lagged(InnerLayer()),
    "averaged": Lagged(Averaged()),
    "least_squares": Lagged(LeastSquares()),
    "frozen": Frozen(),
}
HIGHER: dict[str, Treatment] = {"least_squares_2": Lagged(LeastSquares(2))}  # in the numbers only
RANGE = (0.03, 2.0)  # N/mm²
CHARGES = (0.05, 0.4)  # mol/l
ACCURACY = 1e-4  # of an eigenvalue
STEPS = (0.1, 1.0, 10.0, 100.0, 1000.0)  # s


def material(mu: float, cfc0: float = float(TABLE_1.cfc0)) -> Material:
    """Table 1 with another stiffness [N/mm²] and charge [mol/l]."""
    return replace(TABLE_1, mu=mu, cfc0=cfc0)


def strip(gel: Material, treatment: Treatment, across: int = 1) -> Scene:
    """The strip of Fig. 8 under the load that holds its reference configuration at rest."""
    load = Traction("top", (0.0, -rest_load(gel)))
    return strip_of_table_1(treatment, cells=(across, 30), material=gel, loads=[load])


def block(gel: Material, treatment: Treatment, cells: int = 4) -> Scene:
    """A quarter of a block of 2 mm."""
    return quarter_block(treatment, BATH, cells, material=gel, model=Concentration())


def reference(scene: Scene, gel: Material) -> Snapshot:
    """The initial state."""
    scene.problem.initialise()
    return scene.problem.snapshot(scene.start)


def swollen(scene: Scene, gel: Material) -> Snapshot:
    """The block at rest, homogeneously swollen, in closed form for `gel`; InputError where it swells without bound."""
    problem = scene.problem
    charge = gel.number("cfc0") if isinstance(scene.baths[0].treatment, Frozen) else None
    rest = homogeneous_equilibrium(gel, BATH, "plane strain", boundary_charge=charge)
    problem.initialise()
    problem.fields.components[0].Set((rest.J**0.5 - 1) * CF((x, y)))
    for name, value in (("p", rest.p), ("c", rest.c), ("cfc", rest.cfc)):
        problem.vector[problem.ranges[name]] = value
    return problem.snapshot(scene.start)


@dataclass(frozen=True)
class Body:
    """A family of scenes, the state at rest of each, and a node that shows what grows."""

    build: Callable[..., Scene]
    rest: Callable[[Scene, Material], Snapshot]
    node: tuple[float, float]

    def growth(self, gel: Material, treatment: Treatment, dt: float = STEP, cells: int | None = None) -> complex:
        """Dominant eigenvalue of one step about the state at rest."""
        scene = self.build(gel, treatment) if cells is None else self.build(gel, treatment, cells)
        return scene.growth_factor(dt, self.rest(scene, gel), ACCURACY).factor

    def over_stiffness(self, treatment: Treatment, cfc0: float) -> Callable[[float], float]:
        """|growth| as a function of µ, nan where there is no state at rest. One scene with a Parameter for µ serves all."""
        mu = Parameter(float(TABLE_1.mu))
        scene = self.build(replace(TABLE_1, mu=mu, cfc0=cfc0), treatment)

        def size(value: float) -> float:
            mu.Set(value)
            try:
                rest = self.rest(scene, material(value, cfc0))
            except InputError:
                return np.nan
            return abs(scene.growth_factor(STEP, rest, ACCURACY).factor)

        return size

    def measured(self, gel: Material, treatment: Treatment) -> tuple[float, complex, Result]:
        """Growth in a run from 1e-10 mm of the mode that is predicted to grow most, the prediction, and the run.

        Round-off itself would do as a disturbance where the state at rest is known to round-off; a gel so soft that it
        hardly comes to rest is known to some 1e-13 mm, of all modes.
        """
        scene = self.build(gel, treatment)
        rest = self.rest(scene, gel)
        predicted = scene.growth_factor(STEP, rest, ACCURACY)
        mode = predicted.mode.vec.FV().NumPy()
        start = Snapshot(rest.time, rest.values + 1e-10 / np.abs(mode[scene.problem.ranges["u"]]).max() * mode)
        steps = int(np.log(1e4) / np.log(abs(predicted.factor)))
        probe = Probe(self.node, "displacement")
        result = scene.run(steps * STEP, Fixed(STEP), [probe], resume=start)
        return measured_growth(np.diff(probe.values["displacement"][:, 1])), predicted.factor, result


BODIES = {"strip": Body(strip, reference, (0.0, 0.5)), "block": Body(block, swollen, (1.0, 1.0))}


def safe_stiffness(safe: Callable[[float], bool], stiffness: NDArray, at_points: Sequence[bool], bisections: int) -> float:
    """µ above which it is safe [N/mm²]: bisection in log µ next to the last of the points where it is not."""
    unsafe = np.flatnonzero(~np.array(at_points))
    if not len(unsafe):
        return float(stiffness[0])
    if unsafe[-1] + 1 == len(stiffness):
        raise InputError(f"no safe stiffness up to {stiffness[-1]:g} N/mm²: widen RANGE")
    low, high = stiffness[unsafe[-1]], stiffness[unsafe[-1] + 1]
    for _ in range(bisections):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if safe(middle) else (middle, high)
    return float(np.sqrt(low * high))


def column_safe_stiffness(cfc0: float) -> float:
    """µ at which the factor of the 1-d column, A/(2µ + λ), is −1 [N/mm²]."""
    gel = material(1.0, cfc0)
    return (-lagged_column_factor(gel, BATH) * (2 * gel.number("mu") + gel.number("lam")) - gel.number("lam")) / 2


def smallest_drained_stiffness(problem: Problem) -> float:
    """Smallest eigenvalue of the tangent on displacements with p and c held, the charge following: below 0 it buckles."""
    problem.initialise()
    rows, columns, values = problem.linearise().COO()
    tangent = np.zeros((problem.vector.size, problem.vector.size))
    tangent[np.array(rows), np.array(columns)] = values
    u = np.arange(problem.vector.size)[problem.ranges["u"]]
    u = u[np.array(list(problem.free))[problem.ranges["u"]]]
    s = np.arange(problem.vector.size)[problem.ranges["cfc"]]
    follow = np.linalg.solve(tangent[np.ix_(s, s)], tangent[np.ix_(s, u)])
    return float(np.linalg.eigvals(tangent[np.ix_(u, u)] - tangent[np.ix_(u, s)] @ follow).real.min())


@dataclass(frozen=True)
class GrowthMap:
    """|growth| (rows: charges, columns: stiffness) and the stiffness above which it is below 1 at each charge."""

    stiffness: NDArray
    charges: NDArray
    sizes: NDArray
    safe: NDArray


def survey(body: Body, treatment: Treatment, stiffness: NDArray, charges: NDArray, bisections: int, label: str) -> GrowthMap:
    """One map. Points without a state at rest are nan, and count as unsafe."""
    sizes, safe = np.empty((len(charges), len(stiffness))), np.empty(len(charges))
    for i, cfc0 in enumerate(tqdm(charges, f"stability, {label}", disable=None)):
        size = body.over_stiffness(treatment, cfc0)
        sizes[i] = [size(mu) for mu in stiffness]
        safe[i] = safe_stiffness(lambda mu, size=size: size(mu) < 1, stiffness, sizes[i] < 1, bisections)  # type: ignore[misc]
    return GrowthMap(stiffness, charges, sizes, safe)


def buckling_stiffness(cfc0: float, stiffness: NDArray, bisections: int) -> float:
    """µ below which the strip buckles under p0 [N/mm²]."""
    mu = Parameter(float(TABLE_1.mu))
    problem = strip(replace(TABLE_1, mu=mu, cfc0=cfc0), Frozen()).problem

    def safe(value: float) -> bool:
        mu.Set(value)
        return smallest_drained_stiffness(problem) > 0

    return safe_stiffness(safe, stiffness, [safe(value) for value in stiffness], bisections)


def run(quick: bool = False) -> Findings:
    """Maps, then the dependence on mesh and step, then a few of the predictions against runs."""
    bisections = 2 if quick else 5
    stiffness, charges = np.geomspace(*RANGE, 3 if quick else 9), np.geomspace(*CHARGES, 3 if quick else 7)
    maps = compute(stiffness, charges, bisections)
    load = np.array([buckling_stiffness(cfc0, stiffness, bisections) for cfc0 in charges])
    checks, runs = measurements()
    found = numbers(maps, charges, load) | refinement(quick) | steps(quick) | checks
    found |= {"step_s": STEP, "mesh": "strip 1 x 30, block 4 x 4 quadrilaterals, order 2", **cost(runs)}
    header = ("body", "treatment", "mu_N_mm2", "cfc0_mol_l", "growth_per_step", "safe_above_mu_N_mm2")
    rows = [
        (name, key, float(mu), float(cfc0), float(size), float(safe))
        for (name, key), of_body in maps.items()
        for cfc0, sizes, safe in zip(charges, of_body.sizes, of_body.safe, strict=True)
        for mu, size in zip(stiffness, sizes, strict=True)
    ]
    return Findings(draw(maps, load), header, rows, found)


def compute(stiffness: NDArray, charges: NDArray, bisections: int) -> dict[tuple[str, str], GrowthMap]:
    """The map of every body with every treatment."""
    return {
        (name, key): survey(body, treatment, stiffness, charges, bisections, f"{name} {key}")
        for name, body in BODIES.items()
        for key, treatment in TREATMENTS.items()
    }


def numbers(maps: dict[tuple[str, str], GrowthMap], charges: NDArray, load: NDArray) -> dict[str, float | int | str]:
    """Safe shares of the maps, and safe stiffness at each charge."""
    found: dict[str, float | int | str] = {}
    for (name, key), of_body in maps.items():
        at_rest = np.isfinite(of_body.sizes)
        found[f"{name}_{key}_safe_share"] = float((of_body.sizes < 1).sum() / at_rest.sum())
        found |= {f"{name}_{key}_safe_mu_at_{c:g}": float(safe) for c, safe in zip(charges, of_body.safe, strict=True)}
    for c, mu in zip(charges, load, strict=True):
        found |= {f"column_safe_mu_at_{c:g}": column_safe_stiffness(c), f"load_safe_mu_at_{c:g}": float(mu)}
    return found


def refinement(quick: bool) -> dict[str, float | int | str]:
    """Growth on finer meshes: Table 1's strip cut across, the soft block cut on all sides."""
    numbers: dict[str, float | int | str] = {}
    for key, treatment in (TREATMENTS | HIGHER).items():
        for across in (1, 2) if quick else (1, 2, 4, 8):
            growth = BODIES["strip"].growth(TABLE_1, treatment, cells=across)
            numbers[f"strip_{key}_growth_{across}_across"] = growth.real
        if key == "frozen":
            continue  # µ = 0.06 is too soft for it: no state at rest
        for cells in (2, 4) if quick else (2, 4, 8):
            numbers[f"block_{key}_growth_{cells}_a_side"] = (
                BODIES["block"].growth(material(SOFT), treatment, cells=cells).real
            )
    return numbers


def steps(quick: bool) -> dict[str, float | int | str]:
    """Growth of both soft bodies over the step."""
    return {
        f"{name}_{key}_growth_at_{dt:g}_s": body.growth(material(SOFT), treatment, dt).real
        for name, body in BODIES.items()
        for key, treatment in (TREATMENTS | HIGHER).items()
        if key != "frozen"
        for dt in (STEPS[1:4:2] if quick else STEPS)
    }


def measurements() -> tuple[dict[str, float | int | str], list[Result]]:
    """Predicted growth against that of runs, where there is growth."""
    numbers: dict[str, float | int | str] = {}
    runs = []
    for name, gel, keys in (
        ("strip", TABLE_1, ("lagged",)),
        ("strip", material(SOFT), ("inner_layer", "averaged", "least_squares")),
        ("block", material(SOFT), ("lagged", "averaged")),
    ):
        for key in keys:
            measured, predicted, result = BODIES[name].measured(gel, TREATMENTS[key])
            numbers |= {f"{name}_{key}_measured": measured, f"{name}_{key}_predicted": predicted.real}
            runs.append(result)
    return numbers, runs


TITLES = {
    "lagged": "charge of the last step",
    "inner_layer": "… of the inner layer",
    "averaged": "… averaged",
    "least_squares": "… least squares",
    "frozen": "charge of the start",
}
ROWS = {"strip": "strip, 1 x 30 cells", "block": "quarter of a block, 4 x 4 cells"}
LEVELS = (0.0, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0)
SHADES = ("1.0", "0.9", "0.8", "0.7", "0.58", "0.46")


def draw(maps: dict[tuple[str, str], GrowthMap], load: NDArray) -> Figure:
    """One panel for each body and treatment: white where nothing grows; the safe side of the solid line is its right."""
    shades = ListedColormap(SHADES).with_extremes(over="0.34")
    norm = BoundaryNorm(LEVELS, len(SHADES))
    figure, panels = plt.subplots(2, len(TREATMENTS), figsize=(10.4, 5.4), sharex=True, sharey=True)
    for (name, key), found in maps.items():
        ax = panels[list(BODIES).index(name), list(TREATMENTS).index(key)]
        ax.pcolormesh(found.stiffness, found.charges, found.sizes, norm=norm, cmap=shades, shading="nearest")
        draw_bounds(ax, found, load if name == "strip" else None)
        ax.set(xscale="log", yscale="log", xlim=RANGE, ylim=CHARGES)
        ax.set_xticks([0.05, 0.2, 1.0], ["0.05", "0.2", "1"])
        ax.set_yticks([0.05, 0.1, 0.2, 0.4], ["0.05", "0.1", "0.2", "0.4"])
        ax.minorticks_off()
        ax.set_title(TITLES[key])
    for ax, label in zip(panels[:, 0], ROWS.values(), strict=True):
        ax.set_ylabel(f"{label}\nfixed charge $c^{{fc}}_0$ [mol/l]")
    panels[1, len(TREATMENTS) // 2].set_xlabel("shear modulus $\\mu^S$ [N/mm²]")
    letter_panels(panels.flat)
    bar = figure.colorbar(ScalarMappable(norm, shades), ax=panels, extend="max", aspect=40, pad=0.01)
    bar.set_label("|growth per step| [-]")
    handles: list[Artist] = [
        Line2D([], [], color="k", lw=2, label="|growth| = 1, safe to its right"),
        Line2D([], [], color="k", ls="--", lw=1.2, label="the same of a 1-d column, closed form"),
        Line2D([], [], color="k", ls=":", lw=1.6, label="to its left the strip buckles under its load"),
        Patch(facecolor="none", edgecolor="0.5", hatch="xxxx", lw=0, label="no state at rest"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def draw_bounds(ax: Axes, found: GrowthMap, load: NDArray | None) -> None:
    """Where there is no state at rest, where it is safe, where a column is, and where the load buckles the strip."""
    ax.grid(False)
    nowhere = np.ma.masked_where(np.isfinite(found.sizes), np.ones_like(found.sizes))
    if nowhere.count():
        ax.pcolor(found.stiffness, found.charges, nowhere, hatch="xxxx", facecolor="none", edgecolor="0.5", lw=0)
    fine = np.geomspace(found.charges[0], found.charges[-1], 50)
    ax.plot([column_safe_stiffness(c) for c in fine], fine, "k--", lw=1.2)
    if load is not None:
        ax.plot(_inside(load, found.stiffness), found.charges, "k:", lw=1.6)
    ax.plot(_inside(found.safe, found.stiffness), found.charges, "k-", lw=2)


def _inside(bound: NDArray, stiffness: NDArray) -> NDArray:
    """A bound where it lies within the map; at the map's smallest stiffness it is none."""
    return np.where(bound > stiffness[0], bound, np.nan)
