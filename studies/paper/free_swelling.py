"""Figs. 9 and 10: a hydrogel block swells freely in plane strain when its bath is diluted.

Half of the block is modelled, 1.1 × 1.0 mm² with symmetry on the right, baths on top, left and bottom. From 0 to 7000 s the
fixed charge is brought up and the block comes to rest in 4.1 mol/l; then the baths are diluted, the bottom later than the
rest. Numbers (areas are relative to the area at 7000 s; errors are estimates of those of the reported value):

- `initial_J`, `initial_cfc` [mol/l], `initial_nS`: means over the block at 7000 s, and `closed_form_...` of each;
- `core_J_min`, `core_J_min_time_s`: smallest J on the symmetry line at mid-height after 7000 s, `core_J_initial` before:
  negative osmosis; `corner_J_at_core_min`: J at the free top corner then;
- `arch_max_mm`, `arch_max_time_s`: largest rise of the middle of the bottom above its corner, and when: the bending;
- `area_ratio_7220`, `area_ratio_11000`: with `..._step_error` from a run of fourth order in time at a quarter of the
  tolerance, and `..._mesh_error` from one more on a mesh 1.5 times finer (second order assumed); likewise for `core_J_min`;
- `area_ratio_equilibrium`: when nothing moves any more, with `closed_form_area_ratio_equilibrium`;
- `ramp_seconds`, `equilibrate_seconds`, `ramp_over_equilibrate`: seconds of one processor to the
  state at 7000 s by ramp and directly;
- `fluid_imbalance`, `cation_imbalance`: closure of the ledger relative to the content.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ngswell import BACKWARD_EULER, TABLE_2, Adaptive, Area, Call, Ledger, Probe, Progress, Result, Scene, Snapshots
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.observers.base import Observer
from ngswell.plotting import on_deformed_body
from studies.output import Findings, cost, letter_panels
from studies.scenes import BOTTOM, END, HEIGHT, INITIAL, SIDE, WIDTH, free_swelling_block
from studies.side_by_side import side_by_side

AT_REST = 2e5  # s
PICTURES = (0.0, 7000.0, 7107.0, 7224.0, 7650.0, 11000.0)  # s
REFINEMENT = 1.5
EVERY = 10.0
"""Seconds between the records of runs of fourth order, whose steps are long."""

CORE, CORNER, BOTTOM_MIDDLE = (WIDTH, HEIGHT / 2), (0.0, HEIGHT), (WIDTH, 0.0)
LEVELS = np.linspace(-0.02, 0.16, 10)  # N/mm²


@dataclass(frozen=True)
class WatchedBlock:
    """What was watched in a run, and what the run cost: plain numbers, which pass between processes."""

    time: NDArray
    area: NDArray
    core: NDArray  # J there
    corner: NDArray
    arch: NDArray
    """Rise of the middle of the bottom above the pinned corner [mm]."""

    cost: dict[str, float | int]

    def ratio(self, time: float) -> float:
        """Area at `time` [s] over the area at 7000 s."""
        return float(np.interp(time, self.time, self.area) / self.initial_area)

    @property
    def initial_area(self) -> float:
        return float(np.interp(INITIAL, self.time, self.area))

    def rows(self, name: str) -> list[tuple[object, ...]]:
        """The watched series, a row a record, under the name of the run."""
        series = (self.time, self.area / self.initial_area, self.core, self.corner, self.arch)
        return [(name, *map(float, row)) for row in zip(*series, strict=True)]

    @property
    def core_minimum(self) -> tuple[float, float]:
        """Smallest J of the core after 7000 s, and when [s]."""
        J = np.where(self.time >= INITIAL, self.core, np.inf)
        return float(J.min()), float(self.time[np.argmin(J)])


@dataclass(frozen=True)
class Swelling:
    """The block by the paper's scheme, its pictures and ledger, what its swollen state cost, and its way to rest."""

    scene: Scene
    watched: WatchedBlock
    ledger: Ledger
    pictures: Snapshots
    ramp_seconds: float | None  # of one processor; None where there was no ramp
    to_rest: Result
    rest: Area


@dataclass(frozen=True)
class Accurate:
    """The block of fourth order in time, on the paper's mesh and on a finer one."""

    same_mesh: WatchedBlock
    finer_mesh: WatchedBlock


def options(parser: argparse.ArgumentParser) -> None:
    """`--from-rest`."""
    parser.add_argument("--from-rest", action="store_true", help="free_swelling: skip the ramp of the charge")


def run(quick: bool = False, from_rest: bool = False) -> Findings:
    """The scene by the paper's scheme and on to rest, beside runs of fourth order on its mesh and on a finer one."""
    nx, ny, tolerance = (10, 10, 8e-3) if quick else (22, 20, 1e-3)
    paper, accurate = side_by_side(
        partial(as_in_the_paper, nx, ny, tolerance, from_rest), partial(of_fourth_order, nx, ny, tolerance / 4, from_rest)
    )
    base = paper.watched
    found = numbers(paper, accurate)
    found |= direct_against_ramp(paper, tolerance)
    found |= {"mesh": f"{nx} x {ny} quadrilaterals, order 2", "tolerance": tolerance}
    works = [base.cost, accurate.same_mesh.cost, accurate.finer_mesh.cost, cost([paper.to_rest])]
    found |= {key: round(sum(work[key] for work in works), 2) for key in base.cost}
    rows = base.rows("base") + accurate.same_mesh.rows("fourth order")
    rows += accurate.finer_mesh.rows("fourth order, finer mesh")
    way = zip(paper.rest.time, paper.rest.values, strict=True)
    rows += [("to rest", float(t), float(a) / base.initial_area) for t, a in way]
    header = ("run", "time_s", "area_ratio", "core_J", "corner_J", "arch_mm")
    return Findings(draw(paper, accurate.finer_mesh), header, rows, found)


def as_in_the_paper(nx: int, ny: int, tolerance: float, from_rest: bool) -> Swelling:
    """Backward Euler to 11000 s, and on to rest."""
    scene, control = free_swelling_block(nx, ny), Adaptive(tolerance, scheme=BACKWARD_EULER)
    ledger, pictures = Ledger(), Snapshots([time for time in PICTURES if time >= (INITIAL if from_rest else 0.0)])
    begin, swollen = process_time(), [0.0]
    clock = Call(lambda time, state: swollen.append(process_time() - begin), when=[INITIAL])
    watched, result = watch(scene, control, from_rest, None, [ledger, pictures, clock])
    rest = Area()
    to_rest = scene.run(AT_REST, control, [rest, Progress("free_swelling to rest")], resume=result.end)
    return Swelling(scene, watched, ledger, pictures, None if from_rest else swollen[-1], to_rest, rest)


def of_fourth_order(nx: int, ny: int, tolerance: float, from_rest: bool) -> Accurate:
    """Fourth order in time, on nx × ny cells and on finer ones, with records between the steps."""
    when = [float(time) for time in np.arange(INITIAL, END + EVERY, EVERY)]
    meshes = ((nx, ny), (round(REFINEMENT * nx), round(REFINEMENT * ny)))
    return Accurate(*(watch(free_swelling_block(*mesh), Adaptive(tolerance), from_rest, when)[0] for mesh in meshes))


def watch(
    block: Scene, control: Adaptive, from_rest: bool, when: list[float] | None, others: Sequence[Observer] = ()
) -> tuple[WatchedBlock, Result]:
    """Run to 11000 s, `from_rest` from the state at 7000 s that `equilibrate` reaches directly.

    Records are made at times `when` [s], also within steps, or after every step.
    """
    begin = block.equilibrate(INITIAL) if from_rest else None
    dense = when is not None
    area, bottom = Area(when, dense=dense), Probe(BOTTOM_MIDDLE, "displacement", when=when, dense=dense)
    core, corner = (Probe(point, "J", when=when, dense=dense) for point in (CORE, CORNER))
    progress = Progress(f"free_swelling {block.mesh.ne} cells, {control.scheme.name}, tolerance {control.tolerance:g}")
    result = block.run(END, control, [area, core, corner, bottom, *others, progress], resume=begin)
    J, rise = (core.values["J"], corner.values["J"]), bottom.values["displacement"][:, 1]
    return WatchedBlock(area.time, area.values, *J, rise, cost([result])), result


def numbers(paper: Swelling, accurate: Accurate) -> dict[str, float | int | str]:
    """States at 7000 s and at rest against closed forms, what happens between, and estimated errors."""
    base = paper.watched
    swollen = homogeneous_equilibrium(TABLE_2, SIDE.values[0], "plane strain")
    final = homogeneous_equilibrium(TABLE_2, SIDE.values[-1], "plane strain")
    J = base.initial_area / (WIDTH * HEIGHT)
    core_min, core_min_time = base.core_minimum
    imbalance = paper.ledger.imbalance()
    return {
        "initial_J": J,
        "initial_cfc": (1 - TABLE_2.nS0) * TABLE_2.cfc0 / (J - TABLE_2.nS0),
        "initial_nS": TABLE_2.nS0 / J,
        "closed_form_initial_J": swollen.J,
        "closed_form_initial_cfc": swollen.cfc,
        "closed_form_initial_nS": swollen.nS,
        "core_J_initial": float(np.interp(INITIAL, base.time, base.core)),
        "core_J_min": core_min,
        "core_J_min_time_s": core_min_time,
        "corner_J_at_core_min": float(np.interp(core_min_time, base.time, base.corner)),
        "arch_max_mm": float(base.arch.max()),
        "arch_max_time_s": float(base.time[np.argmax(base.arch)]),
        "area_ratio_7220": base.ratio(7220.0),
        "area_ratio_11000": base.ratio(END),
        "area_ratio_equilibrium": float(paper.rest.values[-1]) / base.initial_area,
        "closed_form_area_ratio_equilibrium": final.J / swollen.J,
        **estimated_errors(base, accurate),
        "fluid_imbalance": imbalance["fluid"],
        "cation_imbalance": imbalance["cations"],
    }


def estimated_errors(base: WatchedBlock, accurate: Accurate) -> dict[str, float]:
    """Errors of the steps from fourth order in time, of the mesh (second order) from the finer one."""
    in_space = REFINEMENT**2 / (REFINEMENT**2 - 1)
    quantities: dict[str, Callable[[WatchedBlock], float]] = {
        "area_ratio_7220": lambda block: block.ratio(7220.0),
        "area_ratio_11000": lambda block: block.ratio(END),
        "core_J_min": lambda block: block.core_minimum[0],
    }
    errors = {}
    for key, value in quantities.items():
        errors[f"{key}_mesh_error"] = in_space * (value(accurate.same_mesh) - value(accurate.finer_mesh))
        errors[f"{key}_step_error"] = value(base) - value(accurate.same_mesh)
    return errors


def direct_against_ramp(paper: Swelling, tolerance: float) -> dict[str, float]:
    """The swollen state at 7000 s, by the ramp of the charge and by `equilibrate`: what each costs."""
    ramp = paper.ramp_seconds
    if ramp is None:
        clock = process_time()
        paper.scene.run(INITIAL, Adaptive(tolerance, scheme=BACKWARD_EULER), [Progress("free_swelling ramp")])
        ramp = process_time() - clock
    clock = process_time()
    paper.scene.equilibrate(INITIAL)
    direct = process_time() - clock
    return {"ramp_seconds": ramp, "equilibrate_seconds": direct, "ramp_over_equilibrate": ramp / direct}


def draw(paper: Swelling, finer: WatchedBlock) -> Figure:
    """Six pictures of the deformed, mirrored block, beside histories of bath, area and core."""
    figure = plt.figure(figsize=(9.6, 6.6))
    grid = figure.add_gridspec(3, 3, width_ratios=(1.25, 1.25, 1))
    norm = BoundaryNorm(LEVELS, 256, extend="both")
    pictures = [figure.add_subplot(grid[n // 2, n % 2]) for n in range(len(paper.pictures.states))]
    draw_pictures(pictures, paper, norm)
    figure.colorbar(
        ScalarMappable(norm), ax=pictures, label="overall pressure p [N/mm²]", location="bottom", shrink=0.6, aspect=40
    )
    histories = [figure.add_subplot(grid[row, 2]) for row in range(3)]
    draw_histories(histories, paper.watched, finer)
    letter_panels([*pictures, *histories])
    return figure


def draw_pictures(panels: list[Axes], paper: Swelling, norm: BoundaryNorm) -> None:
    """Overall pressure on the deformed block, mirrored."""
    for number, (ax, snapshot) in enumerate(zip(panels, paper.pictures.states, strict=True)):
        state = paper.scene.state(snapshot)
        half = on_deformed_body(state, state.p)
        for part in (half, half.mirrored(WIDTH)):
            ax.tricontourf(part.mesh, part.values, levels=LEVELS, norm=norm, extend="both")
            ax.add_collection(LineCollection(list(part.outlines), colors="k", linewidths=0.12))
        ax.set(title=f"{snapshot.time:g} s", aspect="equal", xlim=(-0.95, 3.15), ylim=(-0.25, 1.95))
        ax.grid(False)
        if number % 2 == 0:
            ax.set_ylabel("y [mm]")
        if number >= len(panels) - 2:
            ax.set_xlabel("x [mm]")


def draw_histories(panels: list[Axes], base: WatchedBlock, finer: WatchedBlock) -> None:
    """Baths, area on both meshes, J at the core and at the corner."""
    baths, area, core = panels
    time = np.linspace(6800, END, 2000)
    baths.plot(time / 1000, np.interp(time, SIDE.times, SIDE.values), "k-", label="top, left")
    baths.plot(time / 1000, np.interp(time, BOTTOM.times, BOTTOM.values), "k--", label="bottom")
    baths.set(ylabel="bath [mol/l]", ylim=(0, None))
    baths.legend()
    area.plot(base.time / 1000, base.area / base.initial_area, "k-", label="as in the paper")
    area.plot(finer.time / 1000, finer.area / finer.initial_area, "--", color="0.5", label="finer in space and time")
    area.set(ylabel="area / area at 7000 s", ylim=(0.85, 2.1))
    area.legend(loc="lower right")
    core.plot(base.time / 1000, base.core, "k-", label="core")
    core.plot(base.time / 1000, base.corner, "k:", label="top corner")
    core.set(ylabel="J [-]", xlabel="time [1000 s]", ylim=(0.8, 4.3))
    core.legend(loc="upper right", ncols=2)
    for ax in panels:
        ax.set_xlim(6.8, END / 1000)
