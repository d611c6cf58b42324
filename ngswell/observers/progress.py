"""How far a run is."""

from __future__ import annotations

import sys
from time import perf_counter

import numpy as np
from tqdm import tqdm

from ngswell.files import Tree
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.stepping.steps import Step
from ngswell.stepping.tally import Tally
from ngswell.units import readable


class Progress(Observer):
    """A bar over the simulated time on a terminal; elsewhere one line at the end, with why steps were rejected."""

    def __init__(self, label: str = "run") -> None:
        super().__init__(None, label)
        self.label = label

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._begin, self._clock = begin, perf_counter()
        self._tally = Tally()
        self._reached = begin
        self._bar = tqdm(
            total=until - begin,
            desc=self.label,
            disable=problem.team.rank > 0 or not sys.stderr.isatty(),
            leave=False,
            bar_format="{desc} {percentage:3.0f}%|{bar}| {n:.0f}/{total:.0f} s simulated [{elapsed}<{remaining}{postfix}]",
        )

    def observe(self, problem: Problem, step: Step) -> None:
        self._tally.add(step)
        self._reached = step.time
        self._bar.set_postfix_str(f"step {step.dt:.3g} s, {step.iterations} iterations", refresh=False)
        self._bar.update(step.time - self._begin - self._bar.n)

    def state(self) -> Tree:
        seconds = np.array(perf_counter() - self._clock)
        return {"tally": self._tally.state(), "reached": np.array(self._reached), "seconds": seconds}

    def restore(self, state: Tree) -> None:
        self._tally.restore(state["tally"])
        self._reached = float(state["reached"])
        self._clock -= float(state["seconds"])
        self._bar.update(self._reached - self._begin)

    def finish(self, problem: Problem) -> None:
        self._bar.close()
        if problem.team.rank > 0:
            return
        tally = self._tally
        print(
            f"{self.label}: t = {self._begin:g} s to {readable(self._reached)}, "
            f"{tally.steps} steps ({tally.rejected} rejected), {tally.iterations} Newton iterations, "
            f"{problem.space.ndof} unknowns, {perf_counter() - self._clock:.1f} s"
            + (f"; rejected: {tally.why}" if tally.why else ""),
            file=sys.stderr,
            flush=True,
        )
