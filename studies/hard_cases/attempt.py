"""What the families of `hard_cases` share: one attempt at a scene, and what came of it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ngswell import (
    Concentration,
    DampedNewton,
    Essential,
    InputError,
    Ledger,
    Multiplier,
    NgswellError,
    Nitsche,
    Penalty,
    Potential,
    Problem,
    Result,
    Scene,
    StepError,
)
from ngswell.baths.treatment import Treatment
from ngswell.models.model import Model
from ngswell.observers.base import Observer
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.steps import Control

CHOICES: dict[str, tuple[Model, Treatment]] = {
    "Potential": (Potential(), Essential()),
    "Potential, Penalty": (Potential(), Penalty(relative=1e4)),
    "Concentration": (Concentration(), Penalty(relative=1e4)),
    "Concentration, Multiplier": (Concentration(), Multiplier()),
    "Concentration, Nitsche": (Concentration(), Nitsche()),
}
"""Both models with every stable treatment of a bath."""

DEFAULTS = {name: CHOICES[name] for name in ("Potential", "Concentration")}
"""Both models with the treatment that they take unasked."""


@dataclass(frozen=True)
class Attempt:
    """What came of one scene.

    `outcome` is "passes" (`error`, a relative one of the quantity `measure`, is within `bound`, and the ledger closes to
    `ledger_bound`), "stops" (StepError, and the fields hold a usable last state), "refused" (InputError before anything is
    computed) or "wrong", which must not be. `message` is the exception's, or what is wrong.
    """

    case: str
    variant: str
    outcome: str
    measure: str
    error: float | None = None
    bound: float | None = None
    imbalance: float | None = None
    steps: int = 0
    rejected: int = 0
    iterations: int = 0
    seconds: float = 0.0
    time: float | None = None  # [s] of the last accepted state
    message: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def over_bound(self) -> float:
        """Error over bound of an attempt that passes; a bound of zero is met by zero alone."""
        assert self.error is not None
        assert self.bound is not None
        return self.error / self.bound if self.bound else float(self.error > 0)


def attempt(
    case: str,
    variant: str,
    make: Callable[[], Scene],
    until: float,
    measure: str,
    error: Callable[[Scene, Result], float],
    bound: float,
    steps: Control | None = None,
    observers: Sequence[Observer] = (),
    start: Callable[[Scene], Snapshot] | None = None,
    newton: DampedNewton | None = None,
    ledger_bound: float = 1e-7,
    says: type[Warning] | None = None,
) -> Attempt:
    """Make a scene, run it to `until` [s] (from the snapshot that `start` gives, if any), and judge what comes of it.

    `error` takes the scene and the result. Its `bound` needs a reason. A run that `says` with a warning of that kind what is
    amiss has no error, and the warning for its message.
    """
    ledger = Ledger()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            scene = make()
        except InputError as refused:
            return Attempt(case, variant, "refused", measure, message=str(refused))
        try:
            begin = start(scene) if start else None
            result = scene.run(until, steps, [*observers, ledger], newton=newton, resume=begin)
        except StepError as stopped:
            fault = unusable(scene, stopped.end, stopped.time)
            outcome = "wrong" if fault else "stops"
            return Attempt(case, variant, outcome, measure, time=stopped.time, message=fault or str(stopped))
        except NgswellError as refused:
            return Attempt(case, variant, "refused", measure, message=str(refused))
    told = [str(one.message) for one in caught if says is not None and issubclass(one.category, says)]
    found, open_by = 0.0 if told else float(error(scene, result)), max(ledger.imbalance().values())
    fault = unusable(scene, result.end, until) or missed(found, bound, open_by, ledger_bound)
    return Attempt(
        case,
        variant,
        "wrong" if fault else "passes",
        measure,
        found,
        bound,
        open_by,
        len(result.steps),
        result.rejections,
        result.iterations,
        result.seconds,
        until,
        fault or " ".join(told),
        tuple(dict.fromkeys(str(warning.message) for warning in caught)),
    )


def missed(error: float, bound: float, imbalance: float, ledger_bound: float) -> str:
    """Which bound a run does not meet; empty if it meets both."""
    if not error <= bound:
        return f"error {error:.3g} above {bound:.3g}"
    return "" if imbalance <= ledger_bound else f"the ledger is open by {imbalance:.3g}"


def unusable(scene: Scene, left: Snapshot, time: float) -> str:
    """What is wrong with the state that a run left behind as that at `time` [s]; empty if nothing is."""
    if not np.isfinite(left.values).all():
        return "the last state is not finite"
    if left.time != time:
        return f"the last state is that at {left.time:g} s, not at {time:g} s"
    problem = Problem(scene)
    problem.restore(left)
    found = problem.admissible.violation()
    return f"{found.what} is not positive in the last state near {found.where}" if found else ""
