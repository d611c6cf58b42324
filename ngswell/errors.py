"""The exceptions a user can meet, and why a step can fail. Each message names the thing, its value and the remedy."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import Any


class NgswellError(Exception):
    """Base of all errors raised by ngswell."""


class InputError(NgswellError, ValueError):
    """A scene that cannot be meant: refused before anything is computed."""


class OutputError(NgswellError, OSError):
    """A result that cannot be written where it was asked for."""


class OverlapWarning(UserWarning):
    """A state in which the body overlaps itself, or lies within an obstacle."""


class ExtrapolationWarning(UserWarning):
    """An output is asked for at a corner of a cell where the fields overshoot: J − nS0 is not positive there."""


class UnitsWarning(UserWarning):
    """Numbers of a scene, each possible, hardly belong together: one of them may be in other units."""


class CompilerWarning(UserWarning):
    """Terms were to be compiled to C++, and are not: no compiler is there, or it fails."""


class InstabilityWarning(UserWarning):
    """A run or a state of rest is past the limit of stability: perturbations grow that the numbers do not show."""


class Reason(Enum):
    """Why an attempt at a step, or a state of rest, was given up; the value says it in words."""

    NOT_ADMISSIBLE_AT_START = "the state at the start of the step has {what} not positive"
    NOT_ADMISSIBLE = "{what} would not stay positive"
    IONS_RUN_OUT = "ions run out: {what} would not stay positive"
    TURNS_OVER = "a cell would turn over: {what} would not stay positive"
    NOT_A_SOLUTION = "{what} is not positive in the solution"
    STALLED = "Newton's method stalls: no damped step reduces the correction"
    TOO_MANY_ITERATIONS = "Newton's method needs more than {what} iterations"
    SINGULAR = "the linear system is singular or not finite"
    UNDETERMINED = "the linear system is singular: {what}"
    ESTIMATE_NOT_FINITE = "the estimated error is not finite"
    ERROR_ABOVE_TOLERANCE = "error above the tolerance"
    OUT_OF_BALANCE = "the start is out of balance: {what}"
    LOADED_AT_ONCE = "the load is sudden: {what}"
    CHARGE_OUTRUNS_SALT = "the charge rises faster than salt diffuses in: {what}"
    OSCILLATES = "a bath takes the charge of the last step, and oscillates: {what}"
    UNSTABLE = "the state is unstable: {what}"

    def text(self, what: str = "") -> str:
        """The reason in words, about `what`."""
        return self.value.format(what=what)


_SQUEEZED = "Remedies: a smaller load or change of the bath. Without charge and λ nothing bears more than µ (1 − nS0²)/nS0."

_LOST = (
    "Remedies: a smaller or slower load or change of the bath; if `newton` was given, run without it; if `solver` was "
    "given, the direct one; a law of your own that is smooth and finite."
)

_TURNED = (
    "Remedies: a smaller load or change of the bath. At the edge where a held side meets a free one the strain is "
    "singular, and cells that are very fine there fold: coarser cells at that edge, or an edge that is rounded."
)

REMEDIES = {
    Reason.NOT_ADMISSIBLE_AT_START: (
        "Remedies: go on from an accepted state, `result.end`, `error.end` or a checkpoint; a state that was changed by "
        "hand has to stay within what the body can have."
    ),
    Reason.NOT_ADMISSIBLE: _SQUEEZED,
    Reason.IONS_RUN_OUT: (
        "Remedies: Penalty or Multiplier in place of Nitsche; a bath that changes more slowly, or not to nearly pure water."
    ),
    Reason.TURNS_OVER: _TURNED,
    Reason.NOT_A_SOLUTION: (
        "Remedies: Penalty or Multiplier in place of Nitsche; where anions are few, a slower change of bath or charge."
    ),
    Reason.STALLED: _LOST,
    Reason.TOO_MANY_ITERATIONS: _LOST,
    Reason.SINGULAR: _LOST,
    Reason.ESTIMATE_NOT_FINITE: _LOST,
    Reason.UNDETERMINED: "Remedies: a support for what can move, a bath or a free side for a pressure.",
    Reason.ERROR_ABOVE_TOLERANCE: (
        "Remedies: a history of your own that does not jump, or names the times at which it bends (`kinks`); a larger "
        "tolerance, Adaptive(1e-2); Fixed steps, which estimate no error."
    ),
    Reason.OUT_OF_BALANCE: (
        "Remedies: a start at rest, resume=scene.equilibrate(); a charge that is raised in time, "
        "charge=Ramp((0, 0), (T, 1)), T as long as salt takes to diffuse in; a traction that carries the pressure of the "
        "charged body; where the sudden release is meant, finer cells at the baths, grade={...}."
    ),
    Reason.LOADED_AT_ONCE: (
        "Remedies: a smaller load; Confined, which neither bends nor wrinkles, bears more. Without charge and λ nothing "
        "bears more than µ (1 − nS0²)/nS0."
    ),
    Reason.CHARGE_OUTRUNS_SALT: (
        "Remedies: charge=Ramp((0, 0), (T, 1)) with T at least as long as that; or start with the charge and at rest, "
        "without the ramp: resume=scene.equilibrate(). A sealed body needs a bath."
    ),
    Reason.OSCILLATES: "Remedies: a treatment of the present charge, as Penalty(1.0) or the default; not shorter steps.",
    Reason.UNSTABLE: (
        "Remedies: to let it grow, an imperfection that seeds it, steps well below that time and Stability(follow=True); to "
        "avoid it, a smaller load; in a gel that swells, a bath of more salt; a surface that is held, or Confined, which "
        "leaves wrinkles out."
    ),
}
"""What helps against each reason."""

UNCONVERGED = frozenset({Reason.STALLED, Reason.TOO_MANY_ITERATIONS, Reason.SINGULAR, Reason.ESTIMATE_NOT_FINITE})
"""Reasons that say nothing about the cause yet."""

OF_IONS = frozenset({Reason.IONS_RUN_OUT, Reason.NOT_A_SOLUTION})
"""Reasons that are about ions alone: forces out of balance do not explain them."""


@dataclass(frozen=True)
class Failure:
    """Why an attempt failed: the reason, what it is about (a field's bound, a motion, a number), the field and the place.

    `remedy` is the one to name where the cause, found later, has another than the first reason.
    """

    reason: Reason
    field: str = ""
    where: tuple[float, ...] = ()  # [mm]
    what: str = ""

    @property
    def text(self) -> str:
        return self.reason.text(self.what)

    @property
    def remedy(self) -> str:
        return REMEDIES[self.reason]


def place(where: Any) -> str:
    """A position [mm] in a message."""
    return f"({', '.join(f'{x:.4g}' for x in where)})"


class StepError(NgswellError, RuntimeError):
    """No time step succeeds any more.

    Attributes: `time` [s] of the last accepted state, `step` [s] last tried, `failure` (reason, field with the worst
    correction, where), and `causes` that were found beside it. `end` is the last accepted state, a snapshot that
    `scene.run(..., resume=error.end)` goes on from and `scene.state(error.end)` evaluates.
    """

    end: Any = None

    def __init__(
        self, time: float, step: float, failure: Failure, cause: Failure | None = None, opening: str = "", end: Any = None
    ) -> None:
        self.time, self.step, self.failure, self.cause, self.end = time, step, failure, cause, end
        texts = [] if cause is not None and cause.reason is Reason.UNDETERMINED else [failure.text]
        texts += [] if cause is None else [cause.text]
        opening = opening or f"no step succeeds after t = {time:.10g} s (last tried: {step:.3g} s)"
        super().__init__(
            f"{opening}: {'; '.join(texts)}; "
            f"worst field {failure.field} near {place(failure.where)} mm. "
            f"The last accepted state is that at t = {time:.10g} s. {(cause or failure).remedy}"
        )

    @property
    def reason(self) -> Reason:
        """Why: the cause where one was found, else how the last attempt failed."""
        return (self.cause or self.failure).reason

    @property
    def field(self) -> str:
        return self.failure.field

    @property
    def where(self) -> tuple[float, ...]:
        return self.failure.where


class InstabilityError(StepError):
    """The state reached is unstable, or its growth is not followed by the steps.

    Beside those of StepError, attributes: `rate` of growth [1/s] (infinite: without flow), `wavelength` [mm] of the mode,
    `said`, what is unstable and how.
    """

    def __init__(
        self, time: float, step: float, where: tuple[float, ...], rate: float, wavelength: float, what: str, lost: bool
    ) -> None:
        self.time, self.step, self.rate, self.wavelength = time, step, rate, wavelength
        self.failure, self.cause = Failure(Reason.UNSTABLE, "u", where, what), None
        self.said = f"the state at t = {time:.10g} s is unstable: {what}."
        if lost:
            self.said += f" Stages of {step:.3g} s do not follow that."
        last = f"The last accepted state is that at t = {time:.10g} s."
        RuntimeError.__init__(self, f"{self.said} {last} {self.failure.remedy}")


@dataclass(frozen=True)
class Rejection:
    """A rejected attempt at a step: its size [s], why, what the reason is about, and the estimated error if there is one."""

    dt: float
    reason: Reason
    what: str = ""
    error: float = inf

    def __str__(self) -> str:
        if self.reason is Reason.ERROR_ABOVE_TOLERANCE:
            return f"dt = {self.dt:.3g} s: error {self.error:.2g}"
        return f"dt = {self.dt:.3g} s: {self.reason.text(self.what)}"
