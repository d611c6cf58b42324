"""Random transients of small bodies, and the error in time that runs of them reach.

Columns, blocks and discs of Table 1 or 2, in both models; a bath that is ramped, pulsed or changed at once, a load or a
small load applied at once, a charge that falls, a bath and a load at once, a pulse of the bath's pressure. Sizes of what
happens are spread over decades. Each number stands for one scene, the same in every process.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    DampedNewton,
    PlaneStrain,
    Potential,
    Ramp,
    Result,
    Roller,
    Scene,
    Snapshots,
    Symmetry,
    Traction,
    column,
    rectangle,
)
from ngswell.setup.snapshot import Snapshot
from studies.scenes import rest_load

BODIES = ("column", "block", "disc")
MODELS = (Potential(), Concentration())
EVENTS = ("ramp", "sudden bath", "pulse", "sudden load", "charge", "relaxation", "small load", "pressure pulse")
REFERENCE, EXACT = 1e-7, DampedNewton(tolerance=1e-11, slowest=0.3)
COMPARED = 20
"""States of each run at which it is compared, spread over its steps, the first and the last among them."""


@dataclass(frozen=True)
class RandomRun:
    """A scene, the state that it starts from (None: at rest under its load) and its end [s]."""

    name: str
    scene: Scene
    begin: Snapshot | None
    end: float

    def states(self, steps: Adaptive, when: Sequence[float] | None = None, newton: DampedNewton | None = None) -> Computed:
        """The states after all steps, or at the times `when`, which they then land on."""
        watched = Snapshots(when)
        result = self.scene.run(self.end, steps, [watched], newton=newton, resume=self.begin, unstable="off")
        return Computed(np.array(watched.time), np.array([state.values for state in watched.states]), result)


@dataclass(frozen=True)
class Computed:
    """Times [s], coefficients (a row a time) and what the run took."""

    times: NDArray
    values: NDArray
    result: Result

    @property
    def compared(self) -> NDArray:
        """Numbers of the states that are compared; the first one is the start."""
        last = len(self.times) - 1
        return np.unique(np.linspace(1, last, COMPARED).round().astype(int))


def random_run(number: int) -> RandomRun:
    """The scene of that number."""
    rng = np.random.default_rng(number)
    body, model, event = BODIES[number % 3], MODELS[number // 3 % 2], EVENTS[number // 2 % 8]
    material = (TABLE_1, TABLE_2)[rng.integers(2)]
    height = float(rng.choice([0.5, 1.0]))  # mm
    # about the time in which salt diffuses through
    end = height**2 / material.number("D_plus") / 2 * float(10 ** rng.uniform(-1, 1))
    before = float(10 ** rng.uniform(-1.3, 0.3))  # bath [mol/l]
    after = before * float(10 ** rng.uniform(-0.6, 0.3))
    span = end * float(10 ** rng.uniform(-2.5, -0.3))
    size = float(10 ** rng.uniform(-3, -1.3))  # N/mm²
    changed = {
        "ramp": Ramp((0, before), (span, after)),
        "pulse": Ramp((span * 0.5, before), (span * 0.6, after), (span * 0.9, after), (span, before)),
        "sudden bath": Ramp((0, after)),
        "relaxation": Ramp((0, after)),
    }
    load = {"sudden load": size, "relaxation": 0.3 * size, "small load": 1e-4 + 0.02 * size}.get(event, 0.0)
    less = float(rng.uniform(0.7, 0.95))  # a charge that rises faster than salt diffuses in stops a run
    charge = Ramp((0, 1.0), (span, less)) if event == "charge" else Ramp((0, 1.0))
    pulse = Ramp((0, 0.0), (span * 0.3, size), (span * 0.5, size), (span, 0.0))
    wet = Bath("top", c=changed.get(event, before), P=pulse if event == "pressure pulse" else 0.0, porous_plate=True)
    parts = {"material": material, "model": model, "initial": (before, 0.0)}
    begin = None
    if body != "column":  # which starts at rest under its load
        begin = _scene(body, height, Bath("top", c=before), 0.0, **parts).equilibrate()
    scene = _scene(body, height, wet, load, charge=charge, **parts)
    return RandomRun(f"{number}: {body}, {type(model).__name__}, {event}", scene, begin, end)


def _scene(body: str, height: float, bath: Bath, load: float, **parts: Any) -> Scene:
    """A body under `load` [N/mm²] on top, in a bath like `bath` on its wet sides."""
    loads = [Traction("top", (0.0, -load))] if load else []
    if body == "column":
        held = rest_load(parts["material"], parts["initial"][0])
        return Scene(
            mesh=column(height, 10, grade={"top": 6}), kinematics=Confined(), supports=[Roller("bottom", "x")],
            baths=[bath], loads=[Traction("top", (-held - load,))], **parts,
        )  # fmt: skip
    if body == "block":
        return Scene(
            mesh=rectangle(height, height, 3, 3, grade={"top": 3, "right": 3}), kinematics=PlaneStrain(),
            supports=[Roller("bottom", "y"), Roller("left", "x")],
            baths=[replace(bath, boundary="top|right")], loads=loads, **parts,
        )  # fmt: skip
    return Scene(
        mesh=rectangle(height, height / 2, 3, 3, grade={"right": 3}), kinematics=Axisymmetric(),
        supports=[Symmetry("left"), Roller("bottom", "z")],
        baths=[replace(bath, boundary="right")], loads=loads, **parts,
    )  # fmt: skip


def errors(run: RandomRun, tolerances: Sequence[float]) -> dict[float, float]:
    """By tolerance, the largest error of the displacement over the tolerance.

    Root mean squares of its coefficients, over the largest change since the start, at up to 20 times, against a tolerance of
    1e-7 that lands on them.
    """
    computed = {tolerance: run.states(Adaptive(tolerance)) for tolerance in tolerances}
    when = sorted({float(time) for each in computed.values() for time in each.times[each.compared]})
    exact = run.states(Adaptive(REFERENCE), when, EXACT)
    part = run.scene.problem.ranges["u"]
    size = _rms(exact.values[:, part] - next(iter(computed.values())).values[0, part]).max()
    reached = {}
    for tolerance, each in computed.items():
        rows = np.searchsorted(exact.times, each.times[each.compared])
        defect = each.values[each.compared][:, part] - exact.values[rows][:, part]
        reached[tolerance] = float(_rms(defect).max() / size / tolerance)
    return reached


def _rms(values: NDArray) -> NDArray:
    return np.sqrt(np.mean(values**2, axis=-1))
