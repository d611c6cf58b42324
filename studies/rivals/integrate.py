"""Adaptive Runge-Kutta steps for S(x)˙ + R(x, t) = 0 with kept matrices: numpy only, so that every engine can use it.

Stage i of a step h solves S(x_i) + γh R(x_i) = S(x_n) − h Σ_j a_ij R_j: what is stored, S, is
conserved to what Newton's method leaves.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from time import process_time
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from studies.rivals.block import KINKS, PICTURES, Grid


class Block(Protocol):
    """What an engine has to give; vectors are arrays over all unknowns, zero where there is no balance or content."""

    unknowns: int

    def start(self) -> NDArray:
        """The state at time 0."""

    def at(self, time: float) -> None:
        """Set charge and baths."""

    def prescribe(self, x: NDArray) -> None:
        """Write the baths' values into a state."""

    def residual(self, x: NDArray, step: float) -> NDArray:
        """S(x) + step R(x) of the balances, forces of the momentum balance; zero where values are prescribed."""

    def content(self, x: NDArray) -> NDArray:
        """S(x); zero where values are prescribed."""

    def factorise(self, x: NDArray, step: float) -> None:
        """Keep the factors of the residual's derivative."""

    def solve(self, residual: NDArray) -> NDArray:
        """The kept factors' correction."""

    def area(self, x: NDArray) -> float:
        """Of the deformed block [mm²]."""

    def pressures(self, x: NDArray, time: float) -> NDArray:
        """Overall pressure at `block.SAMPLES` [N/mm²]."""

    def sizes(self, x: NDArray) -> tuple[float, float, float]:
        """Largest absolute values of displacement [mm], P [N/mm²] and salt [mol/l] coefficients."""


@dataclass(frozen=True)
class Scheme:
    """Rows of a stiffly accurate tableau, with an embedded solution unless it is backward Euler's; `power` of its error."""

    rows: tuple[tuple[float, ...], ...]
    embedded: tuple[float, ...] | None
    power: int


_G = 1767732205903 / 4055673282236
SCHEMES = {
    "euler": Scheme(((1.0,),), None, 2),
    # Implicit parts of ARK3(2)4L[2]SA and ARK4(3)6L[2]SA, Kennedy and Carpenter, Appl. Numer. Math. 44 (2003) 139.
    "esdirk3": Scheme(
        (
            (0.0,),
            (_G, _G),
            (2746238789719 / 10658868560708, -640167445237 / 6845629431997, _G),
            (1471266399579 / 7840856788654, -4482444167858 / 7529755066697, 11266239266428 / 11593286722821, _G),
        ),
        (2756255671327 / 12835298489170, -10771552573575 / 22201958757719, 9247589265047 / 10645013368117,
         2193209047091 / 5459859503100),
        3,
    ),
    "esdirk4": Scheme(
        (
            (0.0,),
            (1 / 4, 1 / 4),
            (8611 / 62500, -1743 / 31250, 1 / 4),
            (5012029 / 34652500, -654441 / 2922500, 174375 / 388108, 1 / 4),
            (15267082809 / 155376265600, -71443401 / 120774400, 730878875 / 902184768, 2285395 / 8070912, 1 / 4),
            (82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211, 1 / 4),
        ),
        (4586570599 / 29645900160, 0.0, 178811875 / 945068544, 814220225 / 1159782912, -3700637 / 11593932, 61727 / 225920),
        4,
    ),
}  # fmt: skip

WEIGHTS = (1.0, 0.1, 0.1)
"""Of the errors of displacement, P and salt, each relative to its largest value."""

NEWTON = 0.03
"""Share of the tolerance that Newton's method leaves."""

MOST_ITERATIONS = 10
FIRST = 8.0
"""Step after a kink [s]; a tenth of it for backward Euler, which has no estimate there."""


class NoConvergence(Exception):
    """Newton's method does not converge."""


@dataclass
class Run:
    """One computation: states at all steps, counts and the CPU time of the loop."""

    block: Block
    scheme: Scheme
    tolerance: float
    largest: float = inf  # step [s]
    times: list[float] = field(default_factory=list)
    states: list[NDArray] = field(default_factory=list)
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("rejected", "newton", "factorisations", "solves"), 0)
    )
    seconds: float = 0.0
    scales: NDArray = field(default_factory=lambda: np.array([1e-2, 0.05, 4.1]))
    factored: float = 0.0  # γh of the kept factors; 0: none
    contraction: float = 0.5  # of Newton's method, as last seen

    def norm(self, x: NDArray) -> float:
        return float((np.array(self.block.sizes(x)) / self.scales * WEIGHTS).max())

    def go(self) -> None:
        """From the first of KINKS to the last, stepping onto each and onto PICTURES."""
        clock, b = process_time(), self.block
        time, x = KINKS[0], b.start()
        b.at(time)
        content, rate = b.content(x), np.zeros_like(x)
        self.times, self.states = [time], [x]
        wanted = FIRST
        for end in sorted({*KINKS[1:], *PICTURES}):
            if time in KINKS:
                wanted, points = FIRST * (0.1 if self.scheme.embedded is None else 1.0), [(time, x)]
            while time < end - 1e-9:
                left, wanted = end - time, min(wanted, self.largest)
                h = left if wanted > 0.99 * left else 0.5 * left if wanted > 0.6 * left else wanted
                try:
                    stages, new_content, new_rate, error = self.step(time, h, points, content, rate)
                except NoConvergence:
                    wanted, self.factored = h / 3, 0.0
                    self.counts["rejected"] += 1
                    if wanted < 1e-6:
                        raise
                    continue
                factor = float(np.clip(0.9 * (self.tolerance / max(error, 1e-300)) ** (1 / self.scheme.power), 0.2, 5.0))
                if error > self.tolerance:
                    wanted = h * min(factor, 0.9)
                    self.counts["rejected"] += 1
                    continue
                time, x = (end if h == left else time + h), stages[-1][1]
                content, rate = new_content, new_rate
                points = [*points, *stages][-4:]
                self.scales = np.maximum(self.scales, b.sizes(x))
                self.times.append(time)
                self.states.append(x)
                wanted = max(h * factor, wanted if h == left else 0.0)  # a step cut by a picture says little
        self.seconds = process_time() - clock

    def step(
        self, time: float, h: float, points: list[tuple[float, NDArray]], content: NDArray, rate: NDArray
    ) -> tuple[list[tuple[float, NDArray]], NDArray, NDArray, float]:
        """Stages with their times, content and rate at the end, and the estimated error."""
        rows, b = self.scheme.rows, self.block
        implicit = [row for row in rows if row[-1]]
        rates = [rate] if len(implicit) < len(rows) else []
        stages: list[tuple[float, NDArray]] = []
        for row in implicit:
            at, step = time + h * sum(row), h * row[-1]
            b.at(at)
            known = content - h * sum((a * r for a, r in zip(row[:-1], rates, strict=True)), np.zeros_like(rate))
            guess = extrapolate([*points, *stages][-(3 if self.scheme.embedded else 2) :], at)
            b.prescribe(guess)
            x = self.newton(guess, step, known)
            stored = b.content(x)
            rates.append((known - stored) / step)
            stages.append((at, x))
        if self.scheme.embedded is None:
            error = 0.0
            if len(points) > 1:
                before = points[-1][0] - points[-2][0]
                error = self.norm(stages[-1][1] - extrapolate(points[-2:], time + h)) * h / (h + before)
        else:
            difference = np.array(rows[-1]) - np.array(self.scheme.embedded)
            error = self.norm(b.solve(h * sum((d * r for d, r in zip(difference, rates, strict=True)), np.zeros_like(rate))))
            self.counts["solves"] += 1
        return stages, stored, rates[-1], error

    def newton(self, guess: NDArray, step: float, known: NDArray) -> NDArray:
        """Simplified Newton method with the kept factors, with new ones where they do not contract."""
        fresh = False
        if not self.factored or not 0.7 < step / self.factored < 1.4 or self.contraction > 0.4:
            self.factorise(guess, step)
            fresh = True
        while True:
            x, before = guess.copy(), 0.0
            for _ in range(MOST_ITERATIONS):
                residual = self.block.residual(x, step) - known
                correction = self.block.solve(residual)
                self.counts["newton"] += 1
                self.counts["solves"] += 1
                size = self.norm(correction)
                if not np.isfinite(size) or size > 1e3:
                    break
                x -= correction
                theta = size / before if before else min(max(self.contraction, abs(1 - step / self.factored)), 0.5)
                if before and theta >= 0.9:
                    break
                if theta / (1 - theta) * size <= NEWTON * self.tolerance:
                    self.contraction = theta if before else self.contraction
                    return x
                before = size
            if fresh:
                raise NoConvergence
            self.factorise(guess, step)
            fresh = True

    def factorise(self, x: NDArray, step: float) -> None:
        self.block.factorise(x, step)
        self.counts["factorisations"] += 1
        self.factored, self.contraction = step, 0.2


def extrapolate(points: list[tuple[float, NDArray]], time: float) -> NDArray:
    """The polynomial through points in time; those at the same time count once."""
    distinct = list(dict(points).items())
    total = np.zeros_like(distinct[0][1])
    for i, (at, x) in enumerate(distinct):
        total += np.prod([(time - other) / (at - other) for j, (other, _) in enumerate(distinct) if j != i]) * x
    return total


def outcome(run: Run) -> dict[str, Any]:
    """Areas at all steps, pressures at the pictured times, counts, CPU time."""
    b, at = run.block, dict(zip(run.times, run.states, strict=True))
    pressures = [b.pressures(at[picture], picture).tolist() for picture in PICTURES]
    return {
        "time": run.times,
        "area": [b.area(x) for x in run.states],
        "pressures": pressures,
        "unknowns": b.unknowns,
        "seconds": run.seconds,
        "steps": len(run.times) - 1,
        **run.counts,
    }


def serve(make: Callable[[Grid, bool], Block]) -> None:
    """Build a block and run it once, or whenever a line with scheme and tolerance comes; answers are lines of JSON."""
    cli = argparse.ArgumentParser()
    cli.add_argument("--nx", type=int, default=22)
    cli.add_argument("--ny", type=int, default=20)
    cli.add_argument("--grade", type=float, default=1.0)
    cli.add_argument("--order", type=int, default=2)
    cli.add_argument("--scheme", choices=SCHEMES, default="esdirk4")
    cli.add_argument("--tolerance", type=float, default=1e-3)
    cli.add_argument("--largest", type=float, default=inf, help="step [s]")
    cli.add_argument("--serve", action="store_true", help="run for each line of standard input")
    cli.add_argument("--bytecode", action="store_true", help="NGSolve: no C++ compiler")
    options = cli.parse_args()
    clock = sum(os.times()[:4])  # with the compilers'
    block = make(Grid(options.nx, options.ny, options.grade, options.order), options.bytecode)
    setup = sum(os.times()[:4]) - clock
    if not options.serve:
        found = attempt(block, options.scheme, options.tolerance, options.largest)
        print(
            {key: value for key, value in found.items() if key not in ("time", "area", "pressures")}, f"setup {setup:.1f} s"
        )
        return
    print(json.dumps({"setup": setup}), flush=True)
    for line in sys.stdin:
        scheme, tolerance = line.split()
        print(json.dumps(attempt(block, scheme, float(tolerance), options.largest)), flush=True)


def attempt(block: Block, scheme: str, tolerance: float, largest: float) -> dict[str, Any]:
    """`outcome`, or {"failed": why}."""
    run = Run(block, SCHEMES[scheme], tolerance, largest)
    try:
        run.go()
    except NoConvergence:
        return {"failed": f"Newton's method fails at {run.times[-1]:g} s with any step"}
    return outcome(run)
