"""The experiment behind Figs. 9 and 10 was a cylinder: the free-swelling loading on a disc and on a block in space.

A disc of radius 1.1 mm and height 1.0 mm (axisymmetric) takes the place of the plane block: outside and top go to 0.3 mol/l
at once, the bottom later. An eighth of a block of 2.2 × 2.2 × 1.0 mm³ (3-d) has the quick dilution on all its faces. Both
start at rest in 4.1 mol/l, reached by continuation in the charge. Numbers:

- `disc_initial_J`, `block_initial_J`, `closed_form_initial_J`: volume ratio to the reference at 7000 s;
- `disc_volume_ratio_11000`, `block_volume_ratio_11000`: volume relative to 7000 s;
- `disc_volume_ratio_equilibrium`, `block_volume_ratio_equilibrium`: at rest, from a transient run on to 1e6 s, and
  `closed_form_volume_ratio_equilibrium`; `disc_equilibrate_error`: the same reached directly, relative difference;
- `disc_core_J_min`, `disc_core_J_min_time_s`: smallest J on the axis at mid-height (negative osmosis), `block_core_J_min`;
- `disc_arch_max_mm`, `disc_arch_max_time_s`: rise of the bottom's centre above its rim;
- `disc_fluid_imbalance`, `block_fluid_imbalance`: closure of the ledgers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from ngsolve import CF, ET, IntegrationRule, x, y, z
from numpy.typing import NDArray

from ngswell import (
    BACKWARD_EULER,
    TABLE_2,
    Adaptive,
    Area,
    Axisymmetric,
    Bath,
    Ledger,
    Penalty,
    Pin,
    Probe,
    Progress,
    Result,
    Scene,
    Snapshot,
    Snapshots,
    Spatial,
    Symmetry,
    box,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.plotting import Picture, on_deformed_body
from studies.output import Findings, cost, letter_panels
from studies.scenes import END, INITIAL, SIDE, blended_baths

RADIUS, HEIGHT = 1.1, 1.0  # mm
AT_REST = 1e6  # s
PICTURES = (7000.0, 7224.0, 7650.0, 11000.0)  # s
LEVELS = np.array([-0.4, -0.2, -0.1, -0.05, 0, 0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6])
"""Of the overall pressure [N/mm²]: close where the bodies are most of the time, wide where the rim swells fastest."""

HEADER = ("body", "time_s", "volume_ratio", "core_J")


def disc(n: int) -> Scene:
    """The disc in the (r, z) half-plane; its baths blend over 0.3 mm at the bottom's rim."""
    return Scene(
        mesh=rectangle(RADIUS, HEIGHT, n, n),
        kinematics=Axisymmetric(),
        material=TABLE_2,
        supports=[Symmetry("left"), Pin((RADIUS, 0.0), "z")],
        baths=blended_baths(Penalty(40.0), side="right", from_side=RADIUS - x),
        start=INITIAL,
    )


def block(n: int) -> Scene:
    """An eighth of the block between its symmetry planes."""
    return Scene(
        mesh=box(RADIUS, RADIUS, HEIGHT / 2, n, n, n),
        kinematics=Spatial(),
        material=TABLE_2,
        supports=[Symmetry("left"), Symmetry("front"), Symmetry("bottom")],
        baths=[Bath("right|back|top", c=SIDE, treatment=Penalty(40.0))],
        start=INITIAL,
    )


# -- the runs ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SwellingBody:
    """A body's runs to 11000 s and on to rest, and what was watched."""

    scene: Scene
    result: Result
    rest: Result
    volume: Area
    resting: Area
    core: Probe
    rim: Probe | None
    ledger: Ledger
    pictures: Snapshots

    @property
    def ratios(self) -> NDArray:
        """Volumes over the volume at 7000 s."""
        return np.asarray(self.volume.values) / self.volume.values[0]

    def numbers(self, name: str, reference_volume: float) -> dict[str, float | int | str]:
        """The numbers that both bodies have."""
        J = self.core.values["J"]
        return {
            f"{name}_initial_J": float(self.volume.values[0]) / reference_volume,
            f"{name}_volume_ratio_11000": float(
                np.interp(END, self.volume.time, self.volume.values) / self.volume.values[0]
            ),
            f"{name}_volume_ratio_equilibrium": float(self.resting.values[-1] / self.volume.values[0]),
            f"{name}_core_J_min": float(J.min()),
            f"{name}_core_J_min_time_s": float(self.core.time[np.argmin(J)]),
            f"{name}_fluid_imbalance": self.ledger.imbalance()["fluid"],
        }


def swell(
    label: str, body: Scene, core: Sequence[float], rim: Sequence[float] | None, tolerance: float, pictures: Sequence[float]
) -> SwellingBody:
    """From the swollen state at 7000 s to 11000 s, and on to rest."""
    volume, resting, ledger, snapshots = Area(), Area(), Ledger(), Snapshots(pictures)
    at_core = Probe(core, "J")
    at_rim = None if rim is None else Probe(rim, "displacement")
    swollen = body.equilibrate(INITIAL)
    observers = [volume, at_core, ledger, snapshots, Progress(f"cylinder {label}")] + ([at_rim] if at_rim else [])
    steps = Adaptive(tolerance, scheme=BACKWARD_EULER)
    result = body.run(END, steps, observers, resume=swollen)
    rest = body.run(AT_REST, steps, [resting, Progress(f"cylinder {label} to rest")], resume=result.end)
    return SwellingBody(body, result, rest, volume, resting, at_core, at_rim, ledger, snapshots)


@dataclass(frozen=True)
class Bodies:
    """Disc and block, and J of the disc at rest in the last bath, reached directly."""

    disc: SwellingBody
    block: SwellingBody
    direct_J: float
    tolerance: float
    mesh: str


def run(quick: bool = False) -> Findings:
    """Both bodies."""
    found = compute(quick)
    return Findings(draw(found.disc, found.block), HEADER, rows(found), numbers(found))


def compute(quick: bool) -> Bodies:
    """The runs of both bodies, and the disc's state of rest."""
    n_disc, n_block, tolerance = (10, 2, 1e-2) if quick else (20, 4, 2e-3)
    swollen_disc = swell("disc", disc(n_disc), (0.0, HEIGHT / 2), (0.0, 0.0), tolerance, PICTURES)
    swollen_block = swell("block", block(n_block), (0.0, 0.0, 0.0), None, tolerance, PICTURES[1:])
    direct = swollen_disc.scene.state(swollen_disc.scene.equilibrate(END))
    direct_J = direct.at((RADIUS / 2, HEIGHT / 2), "J")
    mesh = f"disc {n_disc} x {n_disc} quadrilaterals, block {n_block}^3 hexahedra, order 2"
    return Bodies(swollen_disc, swollen_block, direct_J, tolerance, mesh)


def rows(found: Bodies) -> list[Sequence[object]]:
    """Volume and J of the core over time."""
    return [
        (name, float(time), float(ratio), float(J))
        for name, body in (("disc", found.disc), ("block", found.block))
        for time, ratio, J in zip(body.volume.time, body.ratios, body.core.values["J"], strict=True)
    ]


def numbers(found: Bodies) -> dict[str, float | int | str]:
    """The numbers of the study."""
    cylinder, cuboid = found.disc, found.block
    swollen, final = (homogeneous_equilibrium(TABLE_2, c, "3-d") for c in (SIDE.values[0], SIDE.values[-1]))
    assert cylinder.rim is not None
    arch = cylinder.rim.values["displacement"][:, 1]
    return {
        **cylinder.numbers("disc", np.pi * RADIUS**2 * HEIGHT),
        **cuboid.numbers("block", RADIUS**2 * HEIGHT / 2),
        "closed_form_initial_J": swollen.J,
        "closed_form_volume_ratio_equilibrium": final.J / swollen.J,
        "disc_equilibrate_error": abs(found.direct_J / final.J - 1),
        "disc_arch_max_mm": float(arch.max()),
        "disc_arch_max_time_s": float(cylinder.rim.time[np.argmax(arch)]),
        "mesh": found.mesh,
        "tolerance": found.tolerance,
        **cost([cylinder.result, cylinder.rest, cuboid.result, cuboid.rest]),
    }


# -- the figure ----------------------------------------------------------------------------------------------------------


def draw(cylinder: SwellingBody, cuboid: SwellingBody) -> Figure:
    """Sections of the disc above, the eighth of the block seen from its symmetry planes below."""
    discs = [cylinder.scene.state(snapshot) for snapshot in cylinder.pictures.states]
    halves = [on_deformed_body(state, state.pore_pressure) for state in discs]
    surfaces = [surface(cuboid.scene, snapshot) for snapshot in cuboid.pictures.states]
    values = np.concatenate([half.values for half in halves] + [of_face for _, of_face in surfaces])
    levels = enclosing(values)
    norm = BoundaryNorm(levels, 256)

    figure = plt.figure(figsize=(10.0, 5.4))
    grid = figure.add_gridspec(2, 4, height_ratios=(1, 1.2))
    sections = [figure.add_subplot(grid[0, column]) for column in range(len(halves))]
    for ax, half, state in zip(sections, halves, cylinder.pictures.states, strict=True):
        draw_section(ax, half, levels, norm)
        ax.set(title=f"disc, {state.time:g} s", xlabel="r [mm]")
    sections[0].set_ylabel("z [mm]")
    views = [figure.add_subplot(grid[1, column], projection="3d") for column in range(len(surfaces))]
    for ax, (faces, of_face), state in zip(views, surfaces, cuboid.pictures.states, strict=True):
        draw_view(ax, faces, plt.get_cmap()(norm(of_face)))
        ax.set_title(f"block, {state.time:g} s")
    volume = figure.add_subplot(grid[1, 3])
    for name, body, style in (("disc", cylinder, "-"), ("block", cuboid, "--")):
        volume.plot(body.volume.time / 1000, body.ratios, "k" + style, label=name)
    volume.set(title="both bodies", xlabel="time [1000 s]", ylabel="volume / volume at 7000 s")
    volume.legend()
    letter_panels([*sections, *views, volume])
    label = f"overall pressure p [N/mm²], {values.min():.2f} to {values.max():.2f} in these pictures".replace("-", "−")
    bar = figure.colorbar(ScalarMappable(norm), ax=[*sections, *views], location="bottom", shrink=0.6, aspect=45)
    bar.set_ticks(list(levels), labels=[f"{level:g}".replace("-", "−") for level in levels])
    bar.set_label(label)
    return figure


def enclosing(values: NDArray) -> NDArray:
    """Those of `LEVELS` that enclose all values, none more."""
    first, beyond = np.searchsorted(LEVELS, values.min(), "right") - 1, np.searchsorted(LEVELS, values.max())
    return LEVELS[first : beyond + 1]


def draw_section(ax: Axes, half: Picture, levels: NDArray, norm: BoundaryNorm) -> None:
    """The deformed section, both halves."""
    for part in (half, half.mirrored(0.0)):
        ax.tricontourf(part.mesh, part.values, levels=levels, norm=norm)
        ax.add_collection(LineCollection(list(part.outlines), colors="k", linewidths=0.12))
    ax.set(aspect="equal", xlim=(-1.9, 1.9), ylim=(-0.35, 1.75))
    ax.grid(False)


def draw_view(ax: Axes3D, faces: NDArray, colours: NDArray) -> None:
    """The deformed eighth, with a scale."""
    ax.add_collection3d(Poly3DCollection(faces, facecolors=colours, edgecolors=(0, 0, 0, 0.25), linewidths=0.15))
    ax.set(xlim=(0, 1.6), ylim=(0, 1.6), zlim=(0, 0.8))
    ax.set_box_aspect((1.6, 1.6, 0.8), zoom=1.1)
    ax.view_init(elev=24, azim=235)
    ax.set_axis_off()
    ax.plot((0, 0.5), (-0.15, -0.15), (0, 0), "k-", lw=1.5)
    ax.text(0.3, -0.42, 0.0, "0.5 mm", fontsize=7, ha="center")


def surface(body: Scene, snapshot: Snapshot, cuts: int = 3) -> tuple[NDArray, NDArray]:
    """Pieces of the deformed surface (n, 4, 3) [mm] of a body of hexahedra and the mean of p on each [N/mm²]."""
    state, mesh = body.state(snapshot), body.mesh
    side = np.linspace(0.0, 1.0, cuts + 1)
    local = [(a, b) for b in side for a in side]
    rule = IntegrationRule(local, [0.0] * len(local))
    where = mesh.MapToAllElements({ET.QUAD: rule}, mesh.Boundaries(".*"))
    n = cuts + 1
    corner = np.array([row * n + column for row in range(cuts) for column in range(cuts)])
    pieces = np.stack([corner, corner + 1, corner + n + 1, corner + n], 1)
    position = (CF((x, y, z)) + state.u)(where).reshape(-1, n * n, 3)
    pressure = state.pore_pressure(where).reshape(-1, n * n)
    return position[:, pieces].reshape(-1, 4, 3), pressure[:, pieces].mean(axis=2).ravel()
