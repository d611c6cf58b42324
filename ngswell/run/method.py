"""How a run is computed: steps, nonlinear and linear solver, and the answer to instability, checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ngswell import checks
from ngswell.baths.treatment import Charge
from ngswell.errors import InputError
from ngswell.problem.problem import Problem
from ngswell.run.digest import canonical_text
from ngswell.run.guard import Guard
from ngswell.run.restart import Restart
from ngswell.setup.setup import Setup
from ngswell.solve.direct import LinearSolver, checked_solver
from ngswell.solve.newton import DampedNewton
from ngswell.stepping.schemes import BACKWARD_EULER
from ngswell.stepping.stepper import Stepper
from ngswell.stepping.steps import Adaptive, Control
from ngswell.stepping.timetable import Timetable, resolution


@dataclass(frozen=True)
class Method:
    """How a run is computed."""

    control: Control
    newton: DampedNewton
    make_solver: Callable[[Problem], LinearSolver]
    unstable: str  # the answer to a state past the limit of stability

    @classmethod
    def checked(
        cls,
        setup: Setup,
        steps: Control | None,
        newton: DampedNewton | None,
        solver: Callable[[Problem], LinearSolver],
        unstable: str,
    ) -> Method:
        Guard.check("run", unstable)
        control = Adaptive() if steps is None else steps
        checks.instance("steps", control, Control, "Adaptive(tolerance) or Fixed(step)")
        if newton is not None:
            checks.instance("newton", newton, DampedNewton, "a DampedNewton(...) of ngswell")
        if not callable(solver):
            made = "make a linear solver of a problem, such as TwoLevelSolver"
            raise InputError(f"solver has to {made}, got {checks.short(solver)}")
        for bath, treatment in setup.prescribed_baths:
            if treatment.charge_of is Charge.LAST_STEP and control.scheme is not BACKWARD_EULER:
                raise InputError(
                    f"bath on {bath.boundary!r}, {treatment}: that is a condition of backward Euler, not of "
                    f"{control.scheme}; run with steps={type(control).__name__}(..., scheme=BACKWARD_EULER)"
                )
        return cls(control, newton or control.newton, solver, unstable)

    def check_first_step(self, begin: float, until: float) -> None:
        """Refuse a control whose first step the clock does not tell apart."""
        first = self.control.first(until - begin, None)
        if first < resolution(until - begin, begin, until):
            raise InputError(
                f"steps: {self.control} starts with {first:g} s, which is lost in the round-off of a run from {begin:g} to "
                f"{until:g} s; take longer steps or a larger tolerance"
            )

    def stepper(self, problem: Problem, timetable: Timetable, earlier: Restart | None) -> Stepper:
        """The steps from the present fields, as those of the `earlier` part go on."""
        solver = checked_solver(self.make_solver, problem)
        stepper = Stepper(problem, timetable, self.control, solver, self.newton)
        if earlier is not None:
            stepper.restore(earlier.stepper, same=earlier.method == self.text(solver))
        return stepper

    def text(self, solver: LinearSolver) -> str:
        """What tells it from another method, in every process."""
        return canonical_text((self.control, self.newton, type(solver).__name__, solver.name))
