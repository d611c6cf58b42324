"""The exceptions a user can meet. Each message names the thing, its value and the remedy."""

from __future__ import annotations


class NgswellError(Exception):
    """Base of all errors raised by ngswell."""


class InputError(NgswellError, ValueError):
    """A scene that cannot be meant: refused before anything is computed."""


class OutputError(NgswellError, OSError):
    """A result that cannot be written where it was asked for."""


class StepError(NgswellError, RuntimeError):
    """No time step succeeds any more. The scene's fields hold the last accepted state.

    Attributes: `time` [s] of the last accepted state, `step` [s] last tried, `field` with the worst correction,
    `where` its position [mm], `reason` in words.
    """

    def __init__(self, time: float, step: float, field: str, where: tuple[float, ...], reason: str, remedy: str) -> None:
        self.time, self.step, self.field, self.where, self.reason = time, step, field, where, reason
        place = ", ".join(f"{x:.4g}" for x in where)
        super().__init__(
            f"no step succeeds after t = {time:.10g} s (last tried: {step:.3g} s): {reason}; "
            f"worst field {field} near ({place}) mm. The fields hold the state at t = {time:.10g} s. {remedy}"
        )


class InstabilityError(StepError):
    """The state reached is unstable, or its growth is not followed by the steps. The scene's fields hold it.

    Beside those of StepError, attributes: `rate` of growth [1/s] (infinite: without flow), `wavelength` [mm] of the mode.
    """

    def __init__(
        self, time: float, step: float, where: tuple[float, ...], rate: float, wavelength: float, reason: str
    ) -> None:
        self.time, self.step, self.field, self.where, self.reason = time, step, "u", where, reason
        self.rate, self.wavelength = rate, wavelength
        RuntimeError.__init__(self, f"{reason} The fields hold the state at t = {time:.10g} s. {REMEDY}")


REMEDY = (
    "Remedies: to let it grow, an imperfection that seeds it, steps well below that time and Stability(follow=True); to "
    "avoid it, a bath of more salt, a surface that is held, or Confined, which leaves wrinkles out."
)
