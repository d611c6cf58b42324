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

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from netgen.occ import Circle, MoveTo, OCCGeometry
from ngsolve import Integrate, Mesh, x, y
from numpy.typing import NDArray

from ngswell import (
    TABLE_1,
    TABLE_2,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    Fixed,
    Material,
    Newton,
    Penalty,
    PlaneStrain,
    Probe,
    Result,
    Roller,
    Scene,
    Solid,
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
from ngswell.physics import donnan, laws
from ngswell.physics.kinematics import Kinematics
from ngswell.setup.supports import Support
from studies.limits.manufactured import FAST, SLOW, errors, orders
from studies.output import Findings, cost

# -- homogeneous equilibria --------------------------------------------------------------------------------------------


def gel(cfc0: float) -> Material:
    """Table 2 with another charge [mol/l]."""
    return replace(TABLE_2, cfc0=cfc0)


def homogeneous_body(motion: str, cfc0: float, bath: float, model: Model | None = None) -> Scene:
    """A body of one cell (two in the column) with free sides in a bath."""
    bodies: dict[str, tuple[Mesh, Kinematics, list[Support], str]] = {
        "confined": (column(1.0, 2), Confined(), [Roller("bottom", "x")], "top"),
        "plane strain": (rectangle(1, 1, 1, 1), PlaneStrain(), [Symmetry("left"), Symmetry("bottom")], "top|right"),
        "3-d": (box(1, 1, 1, 1, 1, 1), Solid(), [Symmetry(s) for s in ("left", "front", "bottom")], "right|back|top"),
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


def homogeneous(ax: Axes, quick: bool) -> dict[str, float]:
    """J over baths and charges: lines from the scalar equilibrium, dots from the balances."""
    lines, dots = np.logspace(-6, np.log10(5), 60), (1e-6, 1e-3, 0.15, 5.0) if quick else np.logspace(-6, np.log10(5), 8)
    largest = 0.0
    for motion, style in (("confined", ":"), ("plane strain", "--"), ("3-d", "-")):
        for cfc0 in (0.2, 1.0):
            closed = [homogeneous_equilibrium(gel(cfc0), float(c), motion).J for c in lines]
            shade = "k" if cfc0 == 1.0 else "0.55"
            ax.loglog(lines, closed, color=shade, ls=style, lw=1, label=motion if cfc0 == 1.0 else None)
            for c in dots:
                scene = homogeneous_body(motion, cfc0, float(c))
                scene.problem.restore(scene.equilibrate())
                J = scene.problem.state.J(scene.mesh(*(0.5,) * scene.mesh.dim))
                ax.plot(c, J, "o", color=shade, ms=2.5)
                largest = max(largest, abs(J / homogeneous_equilibrium(gel(cfc0), float(c), motion).J - 1))
    ax.set(xlabel="bath [mol/l]", ylabel="J at rest", title="homogeneous swelling", ylim=(0.9, 400))
    ax.legend(loc="upper right", title="charge 1 mol/l, grey 0.2 mol/l", title_fontsize=8)
    return {"homogeneous_error": largest}


# -- consolidation -----------------------------------------------------------------------------------------------------

DRAINED = Material(mu=0.24, lam=0.16, nS0=0.25, cfc0=0.0, D_plus=5e-4, D_minus=8e-4, K=1e-3)
LOAD = 1e-6 * 0.24  # N/mm²: the finite-strain model is linear to 1e-6
EXACT = Newton(tolerance=1e-12)


def extrapolated(scene: Scene, points: list[tuple[float, ...]], T: NDArray, step: float, results: list[Result]) -> NDArray:
    """p/load at the points (rows) and times T (in L²/c_v, L = 1 mm), from backward Euler with three steps."""
    unit = 1 / consolidation.consolidation_coefficient(DRAINED)
    runs = []
    for part in (1, 2, 4):
        probes = [Probe(point, "p", when=list(T * unit)) for point in points]
        results.append(scene.run(float(T[-1]) * unit, Fixed(step / part * unit), probes, newton=EXACT))
        runs.append(np.array([probe.values["p"] for probe in probes]) / LOAD)
    return (8 * runs[2] - 6 * runs[1] + runs[0]) / 3


def terzaghi(ax: Axes, results: list[Result]) -> dict[str, float]:
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
    T, heights = np.array([0.1, 0.2, 0.4, 0.8]), np.linspace(0, 0.95, 20)
    unit = 1 / consolidation.consolidation_coefficient(DRAINED)
    found = extrapolated(scene, [(float(h),) for h in heights], T, 0.02, results)
    fine = np.linspace(0, 1, 101)
    errors = []
    for column_, t in enumerate(T):
        ax.plot(consolidation.terzaghi_pressure(DRAINED, 1.0, 1.0, fine, t * unit), fine, "k-", lw=0.8)
        ax.plot(found[:, column_], heights, "ko", ms=2)
        ax.annotate(f"{t:g}", (found[1, column_], 0.08), fontsize=7, ha="center", backgroundcolor="w")
        errors.append(
            np.abs(found[:, column_] - consolidation.terzaghi_pressure(DRAINED, 1.0, 1.0, heights, t * unit)).max()
        )
    ax.set(xlabel="p / load", ylabel="height / L", title="Terzaghi, at $c_v t/L^2$", xlim=(0, 1.05))
    return {"terzaghi_error": float(max(errors))}


def quarter_disc(maxh: float) -> Mesh:
    """Curved triangles in the (r, z) quarter-plane with boundaries axis, bottom and surface."""
    face = Circle((0, 0), 1).Face() * MoveTo(0, 0).Rectangle(2, 2).Face()
    for edge in face.edges:
        edge.name = "axis" if edge.center.x < 1e-6 else "bottom" if edge.center.y < 1e-6 else "surface"
    return Mesh(OCCGeometry(face, dim=2).GenerateMesh(maxh=maxh))


def cryer(ax: Axes, results: list[Result]) -> dict[str, float]:
    """Pressure at the centre of a sphere under hydrostatic load: it rises before it drains."""
    scene = Scene(
        mesh=quarter_disc(0.3).Curve(4),
        kinematics=Axisymmetric(),
        material=DRAINED,
        model=Uncharged(4),
        supports=[Roller("axis", "r"), Roller("bottom", "z")],
        baths=[Bath("surface", P=-LOAD)],  # no load and suction: the loaded, drained sphere less a uniform pressure
        initial=(None, 0.0),
    )
    T = np.arange(1, 21) * 0.02
    found = 1 + extrapolated(scene, [(0.0, 0.0)], T, 0.01, results)[0]
    fine = np.linspace(0.002, 0.4, 200)
    unit = 1 / consolidation.consolidation_coefficient(DRAINED)
    exact = consolidation.cryer_pressure(DRAINED, 1.0, 1.0, 0.0, T * unit)
    ax.plot(fine, consolidation.cryer_pressure(DRAINED, 1.0, 1.0, 0.0, fine * unit), "k-", lw=0.8, label="series")
    ax.plot(T, found, "ko", ms=2.5, label="computed")
    ax.set(xlabel="$c_v t/R^2$", ylabel="p at the centre / load", title="Cryer's sphere")
    ax.legend()
    late = T > 0.03  # before, the steps do not resolve the boundary layer
    return {
        "cryer_error": float(np.abs(found - exact)[late].max()),
        "cryer_overshoot": float(found.max()),
        "cryer_overshoot_series": float(exact.max()),
    }


# -- the charged column ------------------------------------------------------------------------------------------------


def linear_column(ax: Axes, results: list[Result]) -> dict[str, float]:
    """Top of Table 1's column after a bath step of 1e-5, against the series with the same time steps."""
    bath, change, step = 0.15, 1e-5, 5.0
    load = donnan.pressure(bath, 0.2, TABLE_1.RT)
    tops = []
    for sign in (1, -1):
        scene = Scene(
            mesh=column(0.5, 20),
            kinematics=Confined(),
            material=TABLE_1,
            model=Concentration(4),
            supports=[Roller("bottom", "x")],
            baths=[Bath("top", c=bath * (1 + sign * change), treatment=Penalty(relative=1e6))],
            loads=[Traction("top", (-load,))],
            initial=(bath, 0.0),
        )
        probe = Probe((0.5,), "displacement")
        results.append(scene.run(600.0, Fixed(step), [probe], newton=EXACT))
        tops.append(probe.values["displacement"][1:])
        time = probe.time[1:]
    found = (tops[0] - tops[1]) / 2
    closed = LinearColumn(TABLE_1, bath, 0.5)
    exact = closed.top_displacement(time, salt=bath * change, step=step)
    ax.plot(time, closed.top_displacement(time, salt=bath * change) * 1e6, "k-", lw=0.8, label="series")
    ax.plot(time[::6], found[::6] * 1e6, "ko", ms=2.5, label="computed")
    ax.set(xlabel="time [s]", ylabel="top [1e-6 mm]", title="charged column, small bath step")
    ax.legend()
    return {"linear_column_error": float(np.abs(found - exact).max() / np.abs(exact).max())}


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
    scene = Scene(
        mesh=rectangle(1.0, 1.0, n, n),
        kinematics=PlaneStrain(),
        material=LAYERED,
        model=Concentration(order=order),
        supports=[Symmetry("left"), Symmetry("bottom")],
        baths=[Bath("top|right", c=1.0, treatment=Penalty(relative=1e3))],
    )
    scene.problem.restore(scene.equilibrate())
    out = scene.problem.state.outputs()
    salt = (out["c_plus"] * out["c_minus"] - 1.0) ** 2
    pressure = (out["hydraulic_pressure"] / LAYERED.RT + 2.0) ** 2
    seepage = out["seepage"][0] ** 2 + out["seepage"][1] ** 2
    return np.sqrt([Integrate(error, scene.mesh, order=10) for error in (salt, pressure, seepage)])


def printed_drive(*state_and_gradients):  # type: ignore[no-untyped-def]
    """The fluxes with the factor x = (2c − cfc)/(2c − cfc + cL) on the osmotic gradient, as (19) prints it."""
    material, nF, c, cfc, drive, grad_c, grad_cfc = state_and_gradients
    share = (2 * c - cfc) / (2 * c - cfc + 55.8)
    wrong = drive - (1 - share) * material.RT * (2 * grad_c - grad_cfc)
    return _PROPER(material, nF, c, cfc, wrong, grad_c, grad_cfc)


_PROPER = laws.transport


def donnan_rest(ax: Axes) -> dict[str, float]:
    """Orders with quadratic and cubic u, and the printed drive, which has none."""
    cells = np.array([4, 8, 16])
    numbers = {}
    for order, style in ((2, "o-"), (3, "s--")):
        errors = np.array([unrest(n, order) for n in cells])
        ax.loglog(1 / cells, errors[:, 1], "k" + style, ms=3, lw=0.8, label=f"u of order {order}")
        numbers[f"donnan_order_{order}"] = float(np.log2(errors[1, 0] / errors[2, 0]))
    laws.transport = printed_drive
    try:
        wrong = np.array([unrest(n) for n in cells])
    finally:
        laws.transport = _PROPER
    ax.loglog(1 / cells, wrong[:, 1], "k^:", ms=3, lw=0.8, label="(19) as printed")
    numbers["donnan_printed_drive"] = float(np.log2(wrong[1, 1] / wrong[2, 1]))
    ax.set(xlabel="cell size [mm]", ylabel="|P − P$_{bath}$| / Rθ [mol/l]", title="layered gel at rest")
    ax.set_xticks(1 / cells, [f"1/{n}" for n in cells])
    ax.minorticks_off()
    ax.legend(loc="center right", bbox_to_anchor=(1.0, 0.66))
    return numbers


# -- chosen solutions of the full system -------------------------------------------------------------------------------


def manufactured(ax: Axes) -> dict[str, float]:
    """L2 errors of u and p against chosen fields: quadratic u in a fast motion, cubic u in a slow one."""
    numbers = {}
    for kind, style in (("plane strain", "-"), ("axisymmetric", "--"), ("3-d", ":")):
        for order, duration, shade in ((2, FAST, "k"), (3, SLOW, "0.55")):
            cells = (6, 12) if kind != "3-d" else (2, 4) if order == 2 else (2, 3)
            pair = [errors(kind, order, n, duration) for n in cells]
            for name, marker in (("u", "o"), ("p", "s")):
                sizes = [1 / n for n in cells]
                label = f"{name}, {kind}, order {order}"
                ax.loglog(sizes, [e[name] for e in pair], marker=marker, ls=style, color=shade, ms=3, lw=0.8, label=label)
            for name, order_of in orders(pair[0], pair[1], cells[1] / cells[0]).items():
                if name in ("u", "p", "c"):
                    numbers[f"manufactured_{kind.replace(' ', '_').replace('-', '')}_order_{order}_{name}"] = order_of
    ax.set(xlabel="cell size [mm]", ylabel="L2 error of u, p (mm, N)", title="chosen solutions")
    ax.set_xticks([1 / 12, 1 / 6, 1 / 4, 1 / 2], ["1/12", "1/6", "1/4", "1/2"])
    ax.minorticks_off()
    ax.legend(
        handles=[
            Line2D([], [], color="k", marker="o", ms=3, ls="", label="u"),
            Line2D([], [], color="k", marker="s", ms=3, ls="", label="p"),
            Line2D([], [], color="k", label="order 2"),
            Line2D([], [], color="0.55", label="order 3"),
        ],
        ncols=2,
    )
    return numbers


CASES = ("homogeneous", "terzaghi", "cryer", "linear_column", "donnan", "manufactured")


def run(quick: bool = False) -> Findings:
    """All cases; `quick` takes fewer baths."""
    figure, axes = plt.subplots(2, 3, figsize=(10.0, 6.0))
    results: list[Result] = []
    numbers: dict[str, float | int | str] = {}
    numbers |= homogeneous(axes[0, 0], quick)
    numbers |= terzaghi(axes[0, 1], results)
    numbers |= cryer(axes[0, 2], results)
    numbers |= linear_column(axes[1, 0], results)
    numbers |= donnan_rest(axes[1, 1])
    numbers |= manufactured(axes[1, 2])
    numbers |= {"mesh": "1 to 256 cells of order 2 to 4, by case", **cost(results)}
    rows = [
        (case, line.get_label(), float(a), float(b))
        for case, ax in zip(
            ("homogeneous", "terzaghi", "cryer", "linear_column", "donnan", "manufactured"), axes.flat, strict=True
        )
        for line in ax.get_lines()
        for a, b in zip(line.get_xdata(), line.get_ydata(), strict=True)
    ]
    return Findings(figure, ("case", "series", "x", "y"), rows, numbers)
