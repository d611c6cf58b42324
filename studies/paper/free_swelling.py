"""Figs. 9 and 10: a hydrogel block swells freely in plane strain when its bath is diluted.

Half of the block is modelled, 1.1 × 1.0 mm² with symmetry on the right, baths on top, left and bottom. From 0 to 7000 s the
fixed charge is brought up and the block comes to rest in 4.1 mol/l; then the baths are diluted, the bottom later than the
rest. Numbers (areas are relative to the area at 7000 s; errors are estimates of those of the reported value):

- `initial_J`, `initial_cfc` [mol/l], `initial_nS`: means over the block at 7000 s, and `closed_form_...` of each;
- `core_J_min`, `core_J_min_time_s`: smallest J on the symmetry line at mid-height after 7000 s, `core_J_initial` before:
  negative osmosis; `corner_J_at_core_min`: J at the free top corner then;
- `arch_max_mm`, `arch_max_time_s`: largest rise of the middle of the bottom above its corner, and when: the bending;
- `area_ratio_7220`, `area_ratio_11000`: with `..._mesh_error` from a mesh 1.5 times finer (second order assumed) and
  `..._step_error` from a tolerance four times smaller, which halves the steps (first order); likewise for `core_J_min`;
- `area_ratio_equilibrium`: when nothing moves any more, with `closed_form_area_ratio_equilibrium`;
- `ramp_seconds`, `equilibrate_seconds`, `ramp_over_equilibrate`: cost of the state at 7000 s by ramp and directly;
- `fluid_imbalance`, `cation_imbalance`: closure of the ledger relative to the content.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ngswell import BACKWARD_EULER, TABLE_2, Adaptive, Area, Ledger, Probe, Progress, Result, Scene, Snapshots
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.plotting import on_deformed_body
from studies.output import Findings, cost, letter_panels
from studies.scenes import BOTTOM, END, HEIGHT, INITIAL, SIDE, WIDTH, free_swelling_block

AT_REST = 2e5  # s
PICTURES = (0.0, 7000.0, 7107.0, 7224.0, 7650.0, 11000.0)  # s
REFINEMENT = 1.5
CORE, CORNER, BOTTOM_MIDDLE = (WIDTH, HEIGHT / 2), (0.0, HEIGHT), (WIDTH, 0.0)
LEVELS = np.linspace(-0.02, 0.16, 10)  # N/mm²


@dataclass(frozen=True)
class WatchedBlock:
    """A run of the block with what was watched."""

    scene: Scene
    result: Result
    area: Area
    core: Probe
    corner: Probe
    bottom: Probe
    ledger: Ledger
    pictures: Snapshots

    def ratio(self, time: float) -> float:
        """Area at `time` [s] over the area at 7000 s."""
        return float(np.interp(time, self.area.time, self.area.values) / self.initial_area)

    @property
    def initial_area(self) -> float:
        return float(np.interp(INITIAL, self.area.time, self.area.values))

    @property
    def arch(self) -> NDArray:
        """Rise of the middle of the bottom above the pinned corner [mm]."""
        return self.bottom.values["displacement"][:, 1]

    def rows(self, name: str) -> list[tuple[object, ...]]:
        """The watched series, a row a step, under the name of the run."""
        series = (self.area.values / self.initial_area, self.core.values["J"], self.corner.values["J"], self.arch)
        return [(name, *map(float, row)) for row in zip(self.area.time, *series, strict=True)]

    @property
    def core_minimum(self) -> tuple[float, float]:
        """Smallest J of the core after 7000 s, and when [s]."""
        J = np.where(self.core.time >= INITIAL, self.core.values["J"], np.inf)
        return float(J.min()), float(self.core.time[np.argmin(J)])


@dataclass(frozen=True)
class Blocks:
    """The block on the paper's mesh, on a finer one, in finer steps; the first one's way to rest, and its area on it."""

    base: WatchedBlock
    finer_mesh: WatchedBlock
    finer_steps: WatchedBlock
    to_rest: Result
    rest: Area


def options(parser: argparse.ArgumentParser) -> None:
    """`--from-rest`."""
    parser.add_argument("--from-rest", action="store_true", help="free_swelling: skip the ramp of the charge")


def run(quick: bool = False, from_rest: bool = False) -> Findings:
    """The scene on the paper's mesh, once finer in space, once in time, and on to rest."""
    nx, ny, tolerance = (10, 10, 8e-3) if quick else (22, 20, 1e-3)
    blocks = compute(nx, ny, tolerance, from_rest)
    found = numbers(blocks)
    found |= direct_against_ramp(blocks.base.scene, tolerance)
    found |= {"mesh": f"{nx} x {ny} quadrilaterals, order 2", "tolerance": tolerance}
    found |= cost([blocks.base.result, blocks.finer_mesh.result, blocks.finer_steps.result, blocks.to_rest])
    rows = blocks.base.rows("base") + blocks.finer_mesh.rows("finer mesh") + blocks.finer_steps.rows("finer steps")
    way = zip(blocks.rest.time, blocks.rest.values, strict=True)
    rows += [("to rest", float(t), float(a) / blocks.base.initial_area) for t, a in way]
    header = ("run", "time_s", "area_ratio", "core_J", "corner_J", "arch_mm")
    return Findings(draw(blocks.base, blocks.finer_mesh), header, rows, found)


def compute(nx: int, ny: int, tolerance: float, from_rest: bool) -> Blocks:
    """All runs."""
    base = watch(nx, ny, tolerance, from_rest)
    finer_mesh = watch(round(REFINEMENT * nx), round(REFINEMENT * ny), tolerance, from_rest)
    finer_steps = watch(nx, ny, tolerance / 4, from_rest)
    rest = Area()
    observers = [rest, Progress("free_swelling to rest")]
    to_rest = base.scene.run(AT_REST, Adaptive(tolerance, scheme=BACKWARD_EULER), observers, resume=base.result.end)
    return Blocks(base, finer_mesh, finer_steps, to_rest, rest)


def watch(nx: int, ny: int, tolerance: float, from_rest: bool = False) -> WatchedBlock:
    """Run the scene to 11000 s, `from_rest` from the state at 7000 s that `equilibrate` reaches directly."""
    block = free_swelling_block(nx, ny)
    begin = block.equilibrate(INITIAL) if from_rest else None
    area, ledger = Area(), Ledger()
    core, corner, bottom = Probe(CORE, "J"), Probe(CORNER, "J"), Probe(BOTTOM_MIDDLE, "displacement")
    pictures = Snapshots([time for time in PICTURES if time >= (INITIAL if from_rest else 0.0)])
    label = f"free_swelling {nx} x {ny}, tolerance {tolerance:g}"
    observers = [area, core, corner, bottom, ledger, pictures, Progress(label)]
    result = block.run(END, Adaptive(tolerance, scheme=BACKWARD_EULER), observers, resume=begin)
    return WatchedBlock(block, result, area, core, corner, bottom, ledger, pictures)


def numbers(blocks: Blocks) -> dict[str, float | int | str]:
    """States at 7000 s and at rest against closed forms, what happens between, and estimated errors."""
    base = blocks.base
    swollen = homogeneous_equilibrium(TABLE_2, SIDE.values[0], "plane strain")
    final = homogeneous_equilibrium(TABLE_2, SIDE.values[-1], "plane strain")
    J = base.initial_area / (WIDTH * HEIGHT)
    core_min, core_min_time = base.core_minimum
    imbalance = base.ledger.imbalance()
    return {
        "initial_J": J,
        "initial_cfc": (1 - TABLE_2.nS0) * TABLE_2.cfc0 / (J - TABLE_2.nS0),
        "initial_nS": TABLE_2.nS0 / J,
        "closed_form_initial_J": swollen.J,
        "closed_form_initial_cfc": swollen.cfc,
        "closed_form_initial_nS": swollen.nS,
        "core_J_initial": float(np.interp(INITIAL, base.core.time, base.core.values["J"])),
        "core_J_min": core_min,
        "core_J_min_time_s": core_min_time,
        "corner_J_at_core_min": float(np.interp(core_min_time, base.corner.time, base.corner.values["J"])),
        "arch_max_mm": float(base.arch.max()),
        "arch_max_time_s": float(base.bottom.time[np.argmax(base.arch)]),
        "area_ratio_7220": base.ratio(7220.0),
        "area_ratio_11000": base.ratio(END),
        "area_ratio_equilibrium": float(blocks.rest.values[-1]) / base.initial_area,
        "closed_form_area_ratio_equilibrium": final.J / swollen.J,
        **estimated_errors(blocks),
        "fluid_imbalance": imbalance["fluid"],
        "cation_imbalance": imbalance["cations"],
    }


def estimated_errors(blocks: Blocks) -> dict[str, float]:
    """Errors of the mesh (second order) and of the steps (first order) from the finer runs."""
    in_space = REFINEMENT**2 / (REFINEMENT**2 - 1)
    quantities: dict[str, Callable[[WatchedBlock], float]] = {
        "area_ratio_7220": lambda block: block.ratio(7220.0),
        "area_ratio_11000": lambda block: block.ratio(END),
        "core_J_min": lambda block: block.core_minimum[0],
    }
    errors = {}
    for key, value in quantities.items():
        errors[f"{key}_mesh_error"] = in_space * (value(blocks.base) - value(blocks.finer_mesh))
        errors[f"{key}_step_error"] = 2 * (value(blocks.base) - value(blocks.finer_steps))
    return errors


def direct_against_ramp(block: Scene, tolerance: float) -> dict[str, float]:
    """The swollen state at 7000 s, by the ramp of the charge and by `equilibrate`: what each costs."""
    ramp = block.run(INITIAL, Adaptive(tolerance, scheme=BACKWARD_EULER), [Progress("free_swelling ramp")])
    clock = perf_counter()
    block.equilibrate(INITIAL)
    direct = perf_counter() - clock
    return {"ramp_seconds": ramp.seconds, "equilibrate_seconds": direct, "ramp_over_equilibrate": ramp.seconds / direct}


def draw(base: WatchedBlock, finer: WatchedBlock) -> Figure:
    """Six pictures of the deformed, mirrored block, beside histories of bath, area and core."""
    figure = plt.figure(figsize=(9.6, 6.6))
    grid = figure.add_gridspec(3, 3, width_ratios=(1.25, 1.25, 1))
    norm = BoundaryNorm(LEVELS, 256, extend="both")
    pictures = [figure.add_subplot(grid[n // 2, n % 2]) for n in range(len(base.pictures.states))]
    draw_pictures(pictures, base, norm)
    figure.colorbar(
        ScalarMappable(norm), ax=pictures, label="overall pressure p [N/mm²]", location="bottom", shrink=0.6, aspect=40
    )
    histories = [figure.add_subplot(grid[row, 2]) for row in range(3)]
    draw_histories(histories, base, finer)
    letter_panels([*pictures, *histories])
    return figure


def draw_pictures(panels: list[Axes], base: WatchedBlock, norm: BoundaryNorm) -> None:
    """Overall pressure on the deformed block, mirrored."""
    for number, (ax, snapshot) in enumerate(zip(panels, base.pictures.states, strict=True)):
        state = base.scene.state(snapshot)
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
    area.plot(base.area.time / 1000, base.area.values / base.initial_area, "k-", label="paper's mesh")
    area.plot(finer.area.time / 1000, finer.area.values / finer.initial_area, "--", color="0.5", label="finer mesh")
    area.set(ylabel="area / area at 7000 s", ylim=(0.85, 2.1))
    area.legend(loc="lower right")
    core.plot(base.core.time / 1000, base.core.values["J"], "k-", label="core")
    core.plot(base.corner.time / 1000, base.corner.values["J"], "k:", label="top corner")
    core.set(ylabel="J [-]", xlabel="time [1000 s]", ylim=(0.8, 4.3))
    core.legend(loc="upper right", ncols=2)
    for ax in panels:
        ax.set_xlim(6.8, END / 1000)
