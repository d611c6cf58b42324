"""Step controls: fixed and error-controlled steps; what an accepted step is."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError, Rejection
from ngswell.solve.newton import DampedNewton
from ngswell.stepping.schemes import BACKWARD_EULER, ESDIRK4, Scheme

NEWTON_SHARE = 5e-2
"""What a nonlinear solve may leave of a time error. Later stages take it times a_ij/γ, at most 3.2; the correction that is
applied after the test leaves less. On 16 scenes errors reached are within 4 % of those with 2e-3."""

LOOSEST = 5e-4
"""What a nonlinear solve may leave at most: at tolerances above 1e-2 a gel that curls would end on another branch."""

SMALLEST_TOLERANCE = 1e-12
"""Below it estimated errors are round-off: with 1e-13 a run on six cells finds no step."""

SLOWEST = 0.3
"""Contraction of the Newton iteration from which on a new matrix is cheaper than more iterations with the old one."""

FIRST = 0.14
"""Measured start after a kink: this share of the interval to the next for a tolerance of one, less by the scheme's order."""


class Stage(NamedTuple):
    """A stage of an accepted step: its weight in the step [s], its time [s], its coefficients."""

    weight: float
    time: float
    values: NDArray


@dataclass(frozen=True)
class StepReport:
    """An accepted step: its end [s], its size [s], Newton iterations, what was rejected on the way, the estimated error."""

    time: float
    dt: float
    iterations: int
    rejected: tuple[Rejection, ...] = ()
    error: float = inf


@dataclass(frozen=True)
class Step(StepReport):
    """The same with its stages, the first of which is the state that it starts from, and its scheme, for observers.

    `slope` is what each content falls by in unit time at the end of the step, as the scheme has it; None where only backward
    Euler's steps are taken, in which contents fall evenly.
    """

    stages: tuple[Stage, ...] = ()
    slope: NDArray | None = None
    scheme: Scheme = BACKWARD_EULER

    def weights(self, time: float) -> NDArray:
        """Weights of what is known at the stages that give it at a `time` [s] within the step."""
        return self.scheme.interpolation((time - self.stages[0].time) / (self.time - self.stages[0].time))

    def report(self) -> StepReport:
        """Without the states of the stages."""
        return StepReport(self.time, self.dt, self.iterations, self.rejected, self.error)


@runtime_checkable
class Control(Protocol):
    """Chooses the scheme, how its equations are solved, and step sizes [s]. A control of one's own gives, numbered:

    1. `scheme` and `newton`;
    2. `first` and `next`, the steps to try;
    3. `accepts`, which estimated errors pass.
    """

    @property
    def scheme(self) -> Scheme: ...

    @property
    def newton(self) -> DampedNewton: ...

    def first(self, interval: float, last: float | None) -> float:
        """First step after a kink, when the next kink is `interval` away and `last` was the step before, if any."""
        ...

    def next(self, dt: float, error: float, power: float) -> float:
        """Next step after one of size `dt` with the estimated `error`, which goes with this `power` of the step."""
        ...

    def accepts(self, error: float) -> bool: ...


@dataclass(frozen=True)
class Fixed:
    """Steps of one size [s], shortened to land on kinks and where Newton's method fails; then they grow back by doubling."""

    step: float
    scheme: Scheme = BACKWARD_EULER

    def __post_init__(self) -> None:
        checks.set_fields(self, step=checks.positive("Fixed step", self.step, "s"))
        check_scheme("Fixed", self.scheme)

    @property
    def newton(self) -> DampedNewton:
        return DampedNewton()

    def first(self, interval: float, last: float | None) -> float:
        return self.step

    def next(self, dt: float, error: float, power: float) -> float:
        return min(self.step, 2 * dt)

    def accepts(self, error: float) -> bool:
        return True


@dataclass(frozen=True)
class Adaptive:
    """Steps whose estimated error stays below `tolerance`.

    Errors are root mean squares over the body, relative to what the run itself does: the largest change of the field since
    it began, so far or, by one rough step ahead, until the next kink. With ESDIRK4 the displacement at the end of any step
    is then within three times the tolerance of its largest change, as measured on random scenes. Estimates of the other
    fields are held below the same share of their largest change, or of a tenth of the displacement's in natural sizes,
    whichever is larger. The error is that of the embedded solution times a factor of safety; in the step after a kink,
    where it is far too low in thin layers, ten times as large a one for the displacement. On the free-swelling block
    pressures and concentrations are off by up to nine tolerances at the end of that step, by one and a half after the next.
    With backward Euler, whose error is the difference to linear extrapolation, scaled, the tolerance bounds what one step
    adds, and the error reached goes with its root. Changes below 1e-7 of a natural size count as round-off.
    """

    tolerance: float = 1e-3
    largest: float = inf  # [s]
    scheme: Scheme = ESDIRK4

    def __post_init__(self) -> None:
        tolerance = checks.positive("Adaptive tolerance", self.tolerance)
        if tolerance > 1:
            raise InputError(f"Adaptive tolerance = {tolerance:g} is above 1: errors are relative to the changes, take 1e-3")
        if tolerance < SMALLEST_TOLERANCE:
            raise InputError(
                f"Adaptive tolerance = {tolerance:g} is lost in round-off: take {SMALLEST_TOLERANCE:g} or more, such as 1e-3"
            )
        checks.set_fields(self, tolerance=tolerance)
        if not (checks.is_number(self.largest) and self.largest == inf):
            checks.set_fields(self, largest=checks.positive("Adaptive largest", self.largest, "s"))
        check_scheme("Adaptive", self.scheme)

    @property
    def newton(self) -> DampedNewton:
        """Nonlinear solves that add a small part of the tolerance, with few new matrices."""
        if self.scheme.embedded is None:
            return DampedNewton()
        return DampedNewton(tolerance=min(LOOSEST, NEWTON_SHARE * self.tolerance), slowest=SLOWEST)

    def first(self, interval: float, last: float | None) -> float:
        share = 1 / 100 if self.scheme.embedded is None else FIRST * self.tolerance ** (1 / self.scheme.order)
        start = share * interval
        return min(self.largest, start if last is None else min(last, 4 * start))

    def next(self, dt: float, error: float, power: float) -> float:
        safety = 0.8 if self.scheme.embedded else 0.9
        factor = safety * (self.tolerance / error) ** (1 / power) if error > 0 else inf
        if 1 <= factor < 1.2 and self.scheme.embedded:
            factor = 1.0  # keeps the matrix
        return float(min(self.largest, dt * np.clip(factor, 0.2, 3.0)))

    def accepts(self, error: float) -> bool:
        return error <= self.tolerance


def check_scheme(what: str, scheme: object) -> None:
    """Refuse what is no scheme."""
    checks.instance(f"{what}: scheme", scheme, Scheme, "BACKWARD_EULER or ESDIRK4")
