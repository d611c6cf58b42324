"""What `speed_error` takes as exact: the block's area over time and its pressures, computed once and kept beside this file.

`python -m studies speed_error --references --dolfinx PYTHON` makes it anew (ten minutes or more): DOLFINx, order 5, 16 × 16
cells graded 20 with a tolerance of 1e-7, and as a check ngswell's `Potential(6)` on 10 × 10 other cells with 1e-6. Codes,
orders, meshes, steps and controls of the error differ; the file holds the first and what the second differs by.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ngswell.stepping.attempts import polynomial_at
from studies.rivals.block import KINKS
from studies.scenes import INITIAL

FILE = Path(__file__).with_name("reference.json")


@dataclass(frozen=True)
class Course:
    """Area [mm²] over time [s], and the pressures [N/mm²] at the pictured times and sample points, if they are known."""

    time: NDArray
    area: NDArray
    pressures: NDArray | None


@dataclass
class Reference:
    """What is taken as exact: area over time between the kinks of the baths, and pressures."""

    course: Course
    kinks: Sequence[float] = KINKS

    def area(self, time: NDArray) -> NDArray:
        """Cubic through the four nearest steps, none beyond a kink."""
        values = np.empty_like(time)
        for number, at in enumerate(time):
            after = next(kink for kink in self.kinks[1:] if at <= kink + 1e-6)
            before = max(kink for kink in self.kinks if kink < after)
            inside = np.flatnonzero((self.course.time >= before - 1e-6) & (self.course.time <= after + 1e-6))
            near = inside[np.argsort(np.abs(self.course.time[inside] - at))[:4]]
            values[number] = polynomial_at([(self.course.time[n], self.course.area[n]) for n in near], at)
        return values

    def area_error(self, course: Course) -> float:
        initial = self.area(np.array([INITIAL]))[0]
        return float(np.abs(course.area - self.area(course.time)).max() / initial)

    def pressure_error(self, course: Course) -> float:
        assert course.pressures is not None
        assert self.course.pressures is not None
        size = np.sqrt((self.course.pressures**2).mean(axis=1))
        return float((np.sqrt(((course.pressures - self.course.pressures) ** 2).mean(axis=1)) / size).max())


@dataclass(frozen=True)
class Kept:
    """The reference, and what a second one differs by."""

    reference: Reference
    area_error: float
    pressure_error: float


def read() -> Kept:
    """From the file."""
    found = json.loads(FILE.read_text(encoding="utf-8"))
    time, area, pressures = (np.array(found[name]) for name in ("time", "area", "pressures"))
    return Kept(Reference(Course(time, area, pressures)), found["area_error"], found["pressure_error"])


def write(first: Course, second: Course, how: str) -> None:
    """Into the file: areas to 1e-9, pressures to 1e-7 of their values."""
    reference = Reference(first)
    assert first.pressures is not None
    found = {
        "how": how,
        "area_error": reference.area_error(second),
        "pressure_error": reference.pressure_error(second),
        "time": [float(f"{at:.10g}") for at in first.time],
        "area": [float(f"{value:.10g}") for value in first.area],
        "pressures": [[float(f"{value:.7g}") for value in row] for row in first.pressures],
    }
    FILE.write_text(json.dumps(found).replace("], [", "],\n[") + "\n", encoding="utf-8")
