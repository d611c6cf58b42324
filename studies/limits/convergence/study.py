"""The study: eigenvalues, growth, a disturbance, and the free-swelling scene."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

from studies.limits.convergence.disturbance import RUN_AWAY, STEPS, Departure, departure
from studies.limits.convergence.figure import draw
from studies.limits.convergence.passages import Passage, passage, plans
from studies.limits.convergence.spectra import (
    BATHS,
    SOFTENED,
    STRETCHES,
    Growth,
    Softening,
    closed_forms,
    growth,
    held_eigenvalue,
    softening,
    zero_crossing,
)
from studies.limits.convergence.variants import VARIANTS
from studies.output import Findings

HEADER = ("what", "variant", "size", "at", "value", "count")

RATED = 2.75
"""The J at which the eigenvalues on all meshes are compared: the corner of the scene reaches 3, its rim 2.5."""


@dataclass(frozen=True)
class Evidence:
    """All that is computed; `held` are the eigenvalues with the surface held, by their keys."""

    closed: dict[str, float]
    softenings: list[Softening]
    held: dict[str, float]
    growths: list[Growth]
    departures: list[Departure]
    passages: list[Passage]
    seconds: float


def run(quick: bool = False) -> Findings:
    """Eigenvalues, growth, a disturbance, and the scene."""
    found = compute(quick)
    figure = draw(found.closed, found.softenings, found.growths, found.departures, found.passages)
    return Findings(figure, HEADER, rows(found), numbers(found))


def compute(quick: bool) -> Evidence:
    """Everything, the runs of the scene last."""
    meshes = (4, 8) if quick else (4, 8, 12)
    clock = perf_counter()
    closed = closed_forms()
    softenings = [softening(variant, cells) for variant in SOFTENED for cells in meshes]
    held = {f"{variant}_held_eigenvalue_{meshes[1]}": held_eigenvalue(variant, meshes[1]) for variant in SOFTENED}
    growths = [growth(variant, cells) for variant in VARIANTS for cells in meshes[:2]]
    departures = [departure(variant, label) for variant in SOFTENED for label in STEPS]
    passages = []
    for plan in plans(quick):
        print(f"convergence: {plan.key}, {perf_counter() - clock:.0f} s", file=sys.stderr, flush=True)
        passages.append(passage(plan))
    return Evidence(closed, softenings, held, growths, departures, passages, round(perf_counter() - clock, 2))


def rows(found: Evidence) -> list[Sequence[object]]:
    """The series."""
    of_eigenvalues = [
        ("eigenvalue", s.variant, s.cells, J, value, count)
        for s in found.softenings
        for J, value, count in zip(STRETCHES, s.smallest, s.negative, strict=True)
    ]
    of_growth = [
        ("growth", g.variant, g.cells, J, value, count)
        for g in found.growths
        for J, value, count in zip(g.J, g.fastest, g.growing, strict=True)
    ]
    of_departures = [
        ("disturbance", d.variant, d.label, float(time), float(size), 0)
        for d in found.departures
        for time, size in zip(d.time, d.size, strict=True)
    ]
    of_runs = [("run", p.plan.variant, p.plan.key, p.reached, p.iterations, len(p.failures)) for p in found.passages]
    return [*of_eigenvalues, *of_growth, *of_departures, *of_runs]


def numbers(found: Evidence) -> dict[str, float | int | str]:
    """The numbers of the study."""
    numbers: dict[str, float | int | str] = {**found.closed}
    rated = STRETCHES.index(RATED)
    for s in found.softenings:
        numbers[f"{s.variant}_eigenvalue_{s.cells}_J_{RATED:g}"] = s.smallest[rated]
        numbers[f"{s.variant}_negative_{s.cells}_J_{RATED:g}"] = s.negative[rated]
        numbers[f"{s.variant}_critical_J_{s.cells}"] = zero_crossing(STRETCHES, s.smallest)
    numbers |= found.held
    for g in found.growths:
        for bath in (0.3, RUN_AWAY):
            numbers[f"{g.variant}_growth_{g.cells}_bath_{bath:g}"] = g.fastest[BATHS.index(bath)]
            numbers[f"{g.variant}_growing_{g.cells}_bath_{bath:g}"] = g.growing[BATHS.index(bath)]
    for d in found.departures:
        numbers[f"{d.variant}_disturbance_{d.label}"] = float(d.size[-1])
        if d.label == "ms":
            numbers[f"{d.variant}_measured_growth"] = d.rate
    for p in found.passages:
        numbers |= p.numbers
    meshes = sorted({f"{nx} x {ny}" for nx, ny in (p.plan.cells for p in found.passages)})
    return numbers | {
        "runs_passed": sum(p.passed for p in found.passages),
        "runs_failed": sum(not p.passed for p in found.passages),
        "mesh": ", ".join(meshes) + " quadrilaterals, order 2",
        "steps": sum(p.steps for p in found.passages),
        "rejected_steps": sum(len(p.failures) for p in found.passages),
        "newton_iterations": sum(p.iterations for p in found.passages),
        "seconds": found.seconds,
    }
