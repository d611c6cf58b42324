"""How far a run is."""

from __future__ import annotations

import sys
from time import perf_counter

import numpy as np
from tqdm import tqdm

from ngswell.errors import Reason, Rejection
from ngswell.files import Tree
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.stepping.steps import Step, why


class Progress(Observer):
    """A bar over the simulated time on a terminal; elsewhere one line at the end, with why steps were rejected."""

    def __init__(self, label: str = "run") -> None:
        super().__init__(None, label)
        self.label = label

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._begin, self._clock = begin, perf_counter()
        self._reports = self._iterations = 0
        self._rejected: list[Rejection] = []
        self._reached = begin
        self._bar = tqdm(
            total=until - begin,
            desc=self.label,
            disable=not sys.stderr.isatty(),
            leave=False,
            bar_format="{desc} {percentage:3.0f}%|{bar}| {n:.0f}/{total:.0f} s simulated [{elapsed}<{remaining}{postfix}]",
        )

    def observe(self, problem: Problem, step: Step) -> None:
        self._reports += 1
        self._iterations += step.iterations
        self._rejected += step.rejected
        self._reached = step.time
        self._bar.set_postfix_str(f"step {step.dt:.3g} s, {step.iterations} iterations", refresh=False)
        self._bar.update(step.time - self._begin - self._bar.n)

    def state(self) -> Tree:
        counts = [self._reports, self._iterations, self._reached, perf_counter() - self._clock]
        return {
            "counts": np.array(counts),
            "rejected": {
                "numbers": np.array([(r.dt, r.error) for r in self._rejected]).reshape(-1, 2),
                "reasons": np.array([r.reason.name for r in self._rejected], dtype=str),
                "whats": np.array([r.what for r in self._rejected], dtype=str),
            },
        }

    def restore(self, state: Tree) -> None:
        *counts, self._reached, seconds = state["counts"].tolist()
        self._reports, self._iterations = map(int, counts)
        rejected = state["rejected"]
        entries = zip(rejected["numbers"].tolist(), rejected["reasons"].tolist(), rejected["whats"].tolist(), strict=True)
        self._rejected = [Rejection(dt, Reason[name], what, error) for (dt, error), name, what in entries]
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
