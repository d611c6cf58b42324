"""The cases of the verification book that have a picture. The whole book is docs/verification.md.

Numbers, all relative unless a unit is given:

- `homogeneous_error`: largest error of J over motions, charges and baths, against the scalar equilibrium;
- `terzaghi_error`, `cryer_error`: largest error of pressure/load, extrapolated to no time step, against the series;
- `cryer_overshoot`, `cryer_overshoot_series`: largest sampled pressure at the centre over the load;
- `linear_column_error`: displacement of a charged column after a small bath step against the linearised series of the same
  time steps, over its largest value;
- `donnan_order_2`, `donnan_order_3`: observed order of c₊c₋ = c̄² in a gel of varying charge, u quadratic and cubic;
  `donnan_printed_drive`: the same with the printed factor x in (19), for the hydraulic pressure;
- `manufactured_MOTION_order_K_FIELD`: observed L2 orders of the full system against chosen solutions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from netgen.occ import Circle, MoveTo, OCCGeometry
from ngsolve import Integrate, Mesh, x, y
from numpy.typing import ArrayLike, NDArray

from ngswell import (
    TABLE_1,
    TABLE_2,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    DampedNewton,
    Fixed,
    Material,
    Penalty,
    PlaneStrain,
    Probe,
    Result,
    Roller,
    Scene,
    Spatial,
    Symmetry,
    Traction,
    Uncharged,
    box,
    column,
    rectangle,
)
from ngswell.closed_forms import consolidation
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.closed_forms.linear_column import LinearColumn
from ngswell.models.model import Model
from ngswell.physics import laws
from ngswell.physics.kinematics import Kinematics
from ngswell.setup.supports import Support
from studies.limits.manufactured import FAST, SLOW, errors, orders
from studies.output import Findings, cost, letter_panels
from studies.scenes import BATH, COLUMN_HEIGHT, confined_column, quarter_block


@dataclass(frozen=True)
class Curve:
    """Values over places, times or baths, and how they are drawn; those of one series share its name."""

    series: str
    x: ArrayLike
    y: ArrayLike
    style: dict[str, Any]


@dataclass(frozen=True)
class Comparison:
    """What one case of the book finds: curves, numbers, and the runs in time behind them."""

    curves: list[Curve]
    numbers: dict[str, float]
    results: Sequence[Result] = ()


LINE: dict[str, Any] = {"color": "k", "lw": 0.8}
DOTS: dict[str, Any] = {"color": "k", "marker": "o", "ms": 2.5, "ls": ""}

# -- homogeneous equilibria --------------------------------------------------------------------------------------------


def gel(cfc0: float) -> Material:
    """Table 2 with another charge [mol/l]."""
    return replace(TABLE_2, cfc0=cfc0)


def homogeneous_body(motion: str, cfc0: float, bath: float, model: Model | None = None) -> Scene:
    """A body of one cell (two in the column) with free sides in a bath."""
    bodies: dict[str, tuple[Mesh, Kinematics, list[Support], str]] = {
        "confined": (column(1.0, 2), Confined(), [Roller("bottom", "x")], "top"),
        "plane strain": (rectangle(1, 1, 1, 1), PlaneStrain(), [Symmetry("left"), Symmetry("bottom")], "top|right"),
        "3-d": (box(1, 1, 1, 1, 1, 1), Spatial(), [Symmetry(s) for s in ("left", "front", "bottom")], "right|back|top"),
    }
    mesh, kinematics, supports, wet = bodies[motion]
    return Scene(
        mesh=mesh,
        kinematics=kinematics,
        material=gel(cfc0),
        supports=supports,
        baths=[Bath(wet, c=bath)],
        model=model or Concentration(),
    )


def homogeneous(quick: bool) -> Comparison:
    """J over baths and charges: lines from the scalar equilibrium, dots from the balances."""
    baths, dots = np.logspace(-6, np.log10(5), 60), (1e-6, 1e-3, 0.15, 5.0) if quick else np.logspace(-6, np.log10(5), 8)
    curves, largest = [], 0.0
    for motion, style in (("confined", ":"), ("plane strain", "--"), ("3-d", "-")):
        for cfc0, shade in ((0.2, "0.55"), (1.0, "k")):
            name = f"{motion}, {cfc0:g} mol/l"
            closed = [homogeneous_equilibrium(gel(cfc0), float(c), motion).J for c in baths]
            curves.append(Curve(f"{name}, closed form", baths, closed, {"color": shade, "ls": style, "lw": 1}))
            found = [at_rest(homogeneous_body(motion, cfc0, float(c))) for c in dots]
            curves.append(Curve(name, dots, found, {**DOTS, "color": shade}))
            exact = [homogeneous_equilibrium(gel(cfc0), float(c), motion).J for c in dots]
            largest = max(largest, float(np.abs(np.array(found) / exact - 1).max()))
    return Comparison(curves, {"homogeneous_error": largest})


def at_rest(scene: Scene) -> float:
    """J in the middle of a body at rest."""
    return scene.state(scene.equilibrate()).at((0.5,) * scene.mesh.dim, "J")


# -- consolidation -----------------------------------------------------------------------------------------------------

DRAINED = Material(mu=0.24, lam=0.16, nS0=0.25, K=1e-3)
LOAD = 1e-6 * 0.24  # N/mm²: the finite-strain model is linear to 1e-6
EXACT = DampedNewton(tolerance=1e-12)


def extrapolated(scene: Scene, points: list[tuple[float, ...]], T: NDArray, step: float, results: list[Result]) -> NDArray:
    """p/load at the points (rows) and times T (in L²/c_v, L = 1 mm), from backward Euler with three steps."""
    unit = 1 / consolidation.consolidation_coefficient(DRAINED)
    runs = []
    for part in (1, 2, 4):
        probes = [Probe(point, "p", when=list(T * unit)) for point in points]
        results.append(scene.run(float(T[-1]) * unit, Fixed(step / part * unit), probes, newton=EXACT))
        runs.append(np.array([probe.values["p"] for probe in probes]) / LOAD)
    return (8 * runs[2] - 6 * runs[1] + runs[0]) / 3


T_COLUMN = np.array([0.1, 0.2, 0.4, 0.8])
"""Times in L²/c_v."""


def terzaghi() -> Comparison:
    """Pressure along a column under a sudden load."""
    scene = Scene(
        mesh=column(1.0, 20),
        kinematics=Confined(),
        material=DRAINED,
        model=Uncharged(3),
        supports=[Roller("bottom", "x")],
        baths=[Bath("top")],
        loads=[Traction("top", (-LOAD,))],
    )
    T, heights, fine = T_COLUMN, np.linspace(0, 0.95, 20), np.linspace(0, 1, 101)
    unit = 1 / consolidation.consolidation_coefficient(DRAINED)
    results: list[Result] = []
    found = extrapolated(scene, [(float(h),) for h in heights], T, 0.02, results)
    curves, differences = [], []
    for at, t in enumerate(T):
        series = consolidation.terzaghi_pressure(DRAINED, 1.0, 1.0, fine, t * unit)
        curves.append(Curve(f"{t:g}, series", series, fine, LINE))
        curves.append(Curve(f"{t:g}", found[:, at], heights, {**DOTS, "ms": 2}))
        exact = consolidation.terzaghi_pressure(DRAINED, 1.0, 1.0, heights, t * unit)
        differences.append(np.abs(found[:, at] - exact).max())
    return Comparison(curves, {"terzaghi_error": float(max(differences))}, results)


def quarter_disc(maxh: float) -> Mesh:
    """Curved triangles in the (r, z) quarter-plane with boundaries axis, bottom and surface."""
    face = Circle((0, 0), 1).Face() * MoveTo(0, 0).Rectangle(2, 2).Face()
    for edge in face.edges:
        edge.name = "axis" if edge.center.x < 1e-6 else "bottom" if edge.center.y < 1e-6 else "surface"
    return Mesh(OCCGeometry(face, dim=2).GenerateMesh(maxh=maxh))


def cryer() -> Comparison:
    """Pressure at the centre of a sphere under hydrostatic load: it rises before it drains."""
    scene = Scene(
        mesh=quarter_disc(0.3).Curve(4),
        kinematics=Axisymmetric(),
        material=DRAINED,
        model=Uncharged(4),
        supports=[Roller("axis", "r"), Roller("bottom", "z")],
        baths=[
            Bath("surface", P=-LOAD, porous_plate=True)
        ],  # suction on the fluid alone: the loaded, drained sphere less a uniform pressure
        initial=(None, 0.0),
    )
    T, fine = np.arange(1, 21) * 0.02, np.linspace(0.002, 0.4, 200)
    results: list[Result] = []
    found = 1 + extrapolated(scene, [(0.0, 0.0)], T, 0.01, results)[0]
    unit = 1 / consolidation.consolidation_coefficient(DRAINED)
    exact = consolidation.cryer_pressure(DRAINED, 1.0, 1.0, 0.0, T * unit)
    series = consolidation.cryer_pressure(DRAINED, 1.0, 1.0, 0.0, fine * unit)
    late = T > 0.03  # before, the steps do not resolve the boundary layer
    numbers = {
        "cryer_error": float(np.abs(found - exact)[late].max()),
        "cryer_overshoot": float(found.max()),
        "cryer_overshoot_series": float(exact.max()),
    }
    return Comparison([Curve("series", fine, series, LINE), Curve("computed", T, found, DOTS)], numbers, results)


# -- the charged column ------------------------------------------------------------------------------------------------


def linear_column() -> Comparison:
    """Top of Table 1's column after a bath step of 1e-5, against the series with the same time steps."""
    change, step = 1e-5, 5.0
    tops, results = [], []
    for sign in (1, -1):
        bath, weak = BATH * (1 + sign * change), Penalty(relative=1e6)
        scene = confined_column(weak, bath, 20, model=Concentration(4), initial=(BATH, 0.0))
        probe = Probe((COLUMN_HEIGHT,), "displacement")
        results.append(scene.run(600.0, Fixed(step), [probe], newton=EXACT))
        tops.append(probe.values["displacement"][1:])
        time = probe.time[1:]
    found = (tops[0] - tops[1]) / 2
    closed = LinearColumn(TABLE_1, BATH, COLUMN_HEIGHT)
    exact = closed.top_displacement(time, salt=BATH * change, step=step)
    series = closed.top_displacement(time, salt=BATH * change)
    curves = [Curve("series", time, series * 1e6, LINE), Curve("computed", time[::6], found[::6] * 1e6, DOTS)]
    return Comparison(curves, {"linear_column_error": float(np.abs(found - exact).max() / np.abs(exact).max())}, results)


# -- Donnan equilibrium of a gel that is not homogeneous ---------------------------------------------------------------

LAYERED = Material(  # even in x and y: smooth across the symmetry planes
    mu=0.12 * (1 + y * y),
    lam=0.02,
    nS0=0.2 + 0.1 * x * x,
    cfc0=0.3 + 0.3 * x * x * y * y,
    D_plus=5e-4,
    D_minus=8e-4,
    K=1.07e-3,
)


def unrest(n: int, order: int = 2) -> NDArray:
    """Deviations from uniform c₊c₋ and hydraulic pressure, and the seepage left, of a layered gel at rest (L2 norms)."""
    scene = quarter_block(Penalty(relative=1e3), 1.0, n, material=LAYERED, model=Concentration(order=order))
    out = scene.state(scene.equilibrate()).outputs()
    salt = (out["c_plus"] * out["c_minus"] - 1.0) ** 2
    pressure = (out["fluid_potential"] / LAYERED.RT + 2.0) ** 2
    seepage = out["seepage"][0] ** 2 + out["seepage"][1] ** 2
    return np.sqrt([Integrate(error, scene.mesh, order=10) for error in (salt, pressure, seepage)])


def printed_drive(*state_and_gradients):  # type: ignore[no-untyped-def]
    """The fluxes with the factor x = (2c − cfc)/(2c − cfc + cL) on the osmotic gradient, as (19) prints it."""
    material, J, c, cfc, drive, grad_c, grad_cfc = state_and_gradients
    share = (2 * c - cfc) / (2 * c - cfc + 55.8)
    wrong = drive - (1 - share) * material.RT * (2 * grad_c - grad_cfc)
    return _PROPER(material, J, c, cfc, wrong, grad_c, grad_cfc)


_PROPER = laws.transport


CELLS = np.array([4, 8, 16])
"""Cells a side of the layered gel."""


def donnan_rest() -> Comparison:
    """Orders with quadratic and cubic u, and the printed drive, which has none."""
    curves, numbers = [], {}
    for order, marker, line in ((2, "o", "-"), (3, "s", "--")):
        off = np.array([unrest(n, order) for n in CELLS])
        style = {**LINE, "marker": marker, "ms": 3, "ls": line}
        curves.append(Curve(f"u of order {order}", 1 / CELLS, off[:, 1], style))
        numbers[f"donnan_order_{order}"] = float(np.log2(off[1, 0] / off[2, 0]))
    laws.transport = printed_drive
    try:
        wrong = np.array([unrest(n) for n in CELLS])
    finally:
        laws.transport = _PROPER
    curves.append(Curve("(19) as printed", 1 / CELLS, wrong[:, 1], {**LINE, "marker": "^", "ms": 3, "ls": ":"}))
    numbers["donnan_printed_drive"] = float(np.log2(wrong[1, 1] / wrong[2, 1]))
    return Comparison(curves, numbers)


# -- chosen solutions of the full system -------------------------------------------------------------------------------

MEASURE = {"plane strain": 1.0, "axisymmetric": np.pi, "3-d": 1.0}
"""Of the bodies: area [mm²] of the square, volume [mm³] of the cylinder and the cube."""


def manufactured() -> Comparison:
    """Errors of u and p against chosen fields: quadratic u in a fast motion, cubic u in a slow one.

    The curves are root mean squares over the body [mm, N/mm²].
    """
    curves, numbers = [], {}
    for kind, line in (("plane strain", "-"), ("axisymmetric", "--"), ("3-d", ":")):
        for order, duration, shade in ((2, FAST, "k"), (3, SLOW, "0.55")):
            cells = (6, 12) if kind != "3-d" else (2, 4) if order == 2 else (2, 3)
            pair = [errors(kind, order, n, duration) for n in cells]
            for name, marker in (("u", "o"), ("p", "s")):
                style = {"marker": marker, "ls": line, "color": shade, "ms": 3, "lw": 0.8}
                means = [e[name] / np.sqrt(MEASURE[kind]) for e in pair]
                curves.append(Curve(f"{name}, {kind}, order {order}", [1 / n for n in cells], means, style))
            for name, order_of in orders(pair[0], pair[1], cells[1] / cells[0]).items():
                if name in ("u", "p", "c"):
                    numbers[f"manufactured_{kind.replace(' ', '_').replace('-', '')}_order_{order}_{name}"] = order_of
    return Comparison(curves, numbers)


# -- the study ---------------------------------------------------------------------------------------------------------


def run(quick: bool = False) -> Findings:
    """All cases; `quick` takes fewer baths."""
    found = compute(quick)
    return Findings(draw(found), ("case", "series", "x", "y"), rows(found), numbers(found))


def compute(quick: bool) -> dict[str, Comparison]:
    """The cases by name."""
    return {
        "homogeneous": homogeneous(quick),
        "terzaghi": terzaghi(),
        "cryer": cryer(),
        "linear_column": linear_column(),
        "donnan": donnan_rest(),
        "manufactured": manufactured(),
    }


def rows(found: dict[str, Comparison]) -> list[Sequence[object]]:
    """What the figure shows."""
    return [
        (case, curve.series, float(a), float(b))
        for case, comparison in found.items()
        for curve in comparison.curves
        for a, b in zip(np.asarray(curve.x), np.asarray(curve.y), strict=True)
    ]


def numbers(found: dict[str, Comparison]) -> dict[str, float | int | str]:
    """The numbers of all cases."""
    numbers: dict[str, float | int | str] = {}
    for comparison in found.values():
        numbers |= comparison.numbers
    results = [result for comparison in found.values() for result in comparison.results]
    return numbers | {"mesh": "1 to 256 cells of order 2 to 4, by case", **cost(results)}


# -- the figure --------------------------------------------------------------------------------------------------------


def draw(found: dict[str, Comparison]) -> Figure:
    """One panel a case."""
    figure, axes = plt.subplots(2, 3, figsize=(10.0, 6.0))
    panels = dict(zip(found, axes.flat, strict=True))
    for case, comparison in found.items():
        for curve in comparison.curves:
            panels[case].plot(curve.x, curve.y, label=curve.series, **curve.style)
    label_consolidation(panels["terzaghi"], panels["cryer"], found["terzaghi"])
    label_equilibria(panels["homogeneous"], panels["donnan"])
    panels["linear_column"].set(xlabel="time [s]", ylabel="top [1e-6 mm]", title="charged column, small bath step")
    panels["linear_column"].legend()
    label_manufactured(panels["manufactured"])
    letter_panels(panels.values())
    return figure


def label_consolidation(column: Axes, sphere: Axes, terzaghi: Comparison) -> None:
    """Terzaghi's column, with the time beside each curve, and Cryer's sphere."""
    for curve, t in zip(terzaghi.curves[1::2], T_COLUMN, strict=True):
        column.annotate(f"{t:g}", (np.asarray(curve.x)[1], 0.05), (5, 0), textcoords="offset points", fontsize=7)
    column.set(xlabel="p / load", ylabel="height / L", title="Terzaghi, at $c_v t/L^2$", xlim=(0, 1.05))
    sphere.set(xlabel="$c_v t/R^2$", ylabel="p at the centre / load", title="Cryer's sphere")
    sphere.legend()


def label_equilibria(homogeneous: Axes, layered: Axes) -> None:
    """Homogeneous bodies over their baths, and the layered gel over its cells."""
    homogeneous.set(xscale="log", yscale="log", ylim=(0.9, 400))
    homogeneous.set(xlabel="bath [mol/l]", ylabel="J at rest", title="homogeneous swelling")
    styles = (("confined", ":"), ("plane strain", "--"), ("3-d", "-"))
    motions = [Line2D([], [], color="k", ls=line, lw=1, label=motion) for motion, line in styles]
    homogeneous.legend(handles=motions, loc="upper right", title="charge 1 mol/l, grey 0.2 mol/l", title_fontsize=8)
    layered.set(xscale="log", yscale="log", title="layered gel at rest")
    layered.set(xlabel="cell size [mm]", ylabel="|P − P$_{bath}$| / Rθ [mol/l]")
    layered.set_xticks(1 / CELLS, [f"1/{n}" for n in CELLS])
    layered.minorticks_off()
    layered.legend(loc="center right", bbox_to_anchor=(1.0, 0.66))


def label_manufactured(ax: Axes) -> None:
    """Chosen solutions over the cell size."""
    ax.set(xscale="log", yscale="log", title="chosen solutions")
    ax.set(xlabel="cell size [mm]", ylabel="rms error of u [mm], p [N/mm²]")
    ax.set_xticks([1 / 12, 1 / 6, 1 / 4, 1 / 2], ["1/12", "1/6", "1/4", "1/2"])
    ax.minorticks_off()
    ax.set_ylim(1e-10, None)
    handles = [
        Line2D([], [], color="k", marker=marker, ms=3, ls="", label=name) for name, marker in (("u", "o"), ("p", "s"))
    ]
    handles += [Line2D([], [], color=shade, label=f"order {order}") for order, shade in ((2, "k"), (3, "0.55"))]
    motions = (("plane strain", "-"), ("axisymmetric", "--"), ("3-d", ":"))
    handles += [Line2D([], [], color="k", lw=0.8, ls=line, label=motion) for motion, line in motions]
    ax.legend(handles=handles, ncols=2, loc="lower right")
