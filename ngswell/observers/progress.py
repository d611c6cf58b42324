"""How far a run is."""

from __future__ import annotations

import sys
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.stepping.stepper import StepReport, why


class Progress(Observer):
    """A bar over the simulated time on a terminal; elsewhere one line at the end, with why steps were rejected."""

    def __init__(self, label: str = "run") -> None:
        super().__init__(None, label)
        self.label = label

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._begin, self._clock = begin, perf_counter()
        self._reports = self._iterations = 0
        self._rejected: list[str] = []
        self._reached = begin
        self._bar = tqdm(
            total=until - begin,
            desc=self.label,
            disable=not sys.stderr.isatty(),
            leave=False,
            bar_format="{desc} {percentage:3.0f}%|{bar}| {n:.0f}/{total:.0f} s simulated [{elapsed}<{remaining}{postfix}]",
        )

    def observe(self, problem: Problem, report: StepReport) -> None:
        self._reports += 1
        self._iterations += report.iterations
        self._rejected += report.rejected
        self._reached = report.time
        self._bar.set_postfix_str(f"step {report.dt:.3g} s, {report.iterations} iterations", refresh=False)
        self._bar.update(report.time - self._begin - self._bar.n)

    def memory(self) -> dict[str, NDArray]:
        counts = [self._reports, self._iterations, self._reached, perf_counter() - self._clock]
        return {"counts": np.array(counts), "rejected": np.array(self._rejected, dtype=str)}

    def remember(self, memory: dict[str, NDArray]) -> None:
        *counts, self._reached, seconds = memory["counts"].tolist()
        self._reports, self._iterations = map(int, counts)
        self._rejected = memory["rejected"].tolist()
        self._clock -= seconds
        self._bar.update(self._reached - self._begin)

    def finish(self, problem: Problem) -> None:
        self._bar.close()
        rejected, reasons = len(self._rejected), why(self._rejected)
        print(
            f"{self.label}: t = {self._begin:g} to {self._reached:g} s, {self._reports} steps ({rejected} rejected), "
            f"{self._iterations} Newton iterations, {problem.space.ndof} unknowns, {perf_counter() - self._clock:.1f} s"
            + (f"; rejected: {reasons}" if reasons else ""),
            file=sys.stderr,
            flush=True,
        )
