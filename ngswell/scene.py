"""A scene: a setup that runs."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from ngswell import checks
from ngswell.analysis.one_step import Growth, growth_factor
from ngswell.baths.bath import Bath
from ngswell.calls import in_turn
from ngswell.errors import InputError
from ngswell.observers.base import Observer
from ngswell.observers.records import power_of_mm, product
from ngswell.problem.compiling import why_not
from ngswell.problem.discretisation import Discretisation
from ngswell.problem.handed_on import handed_on
from ngswell.problem.problem import Problem
from ngswell.run.checkpoint import Checkpoint
from ngswell.run.equilibrium import equilibrate
from ngswell.run.restart import Restart
from ngswell.run.result import Result
from ngswell.run.run import run
from ngswell.run.threads import threads_said
from ngswell.schedules import Ramp
from ngswell.setup.limits import limits
from ngswell.setup.loads import Load
from ngswell.setup.sequence import following
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.setup.supports import Support
from ngswell.solve.choice import solver_of, solver_said
from ngswell.solve.direct import LinearSolver
from ngswell.solve.newton import DampedNewton
from ngswell.stepping.steps import Control
from ngswell.streams import CSV


@dataclass(frozen=True, kw_only=True)
class Scene(Setup):
    __doc__ = Setup.__doc__

    def __reduce__(self) -> tuple[Callable[[bytes], Scene], tuple[bytes]]:
        """For other processes: the pieces, not what was made of them. Raises InputError for one that cannot be sent."""
        pieces = {piece.name: getattr(self, piece.name) for piece in fields(self) if piece.init}
        try:
            return _unpickled, (pickle.dumps(pieces),)
        except Exception:  # of pickle, of NGSolve, of a piece of the user's
            name, error = next((name, error) for name, value in pieces.items() if (error := _misfit(value)))
            raise InputError(
                f"{name} of the scene cannot be sent to another process ({error}); functions have to be defined at the top "
                "of a module, not as a lambda or inside another function, or make the scene in the process that runs it"
            ) from None

    @property
    def problem(self) -> Problem:
        """A discrete problem of the scene to look into: spaces, terms, forms. Runs make their own and leave it as it is."""
        self.mesh_shape.check(self.mesh)
        return self._problem

    @cached_property
    @in_turn
    def _problem(self) -> Problem:
        return Problem(self)

    @in_turn
    def state(self, snapshot: Snapshot) -> Any:
        """The model's state at a snapshot: `scene.state(scene.equilibrate()).at((1.1, 0.5), "J")`. No run changes it."""
        return Discretisation(self).state_at(snapshot)

    @in_turn
    def after(
        self,
        end: Result | Snapshot,
        *,
        start: float | None = None,
        baths: Sequence[Bath] | None = None,
        loads: Sequence[Load] | None = None,
        supports: Sequence[Support] | None = None,
        charge: Ramp | None = None,
    ) -> Scene:
        """The next part of a test: this scene with other pieces, which starts from where `end` leaves the body.

            swollen = scene.run(3600)
            diluted = scene.after(swollen, start=0.0, baths=[Bath("top", c=Ramp((0, 0.15), (10, 0.1)))]).run(600)

        `end` is a result or a snapshot of this scene, such as its state of rest. Pieces that are not given stay. Times go
        on from those of `end`; with `start=0.0` the clock of the new part starts at zero, and histories count from now.
        What the new scene does, checkpoints and observers included, begins there. Baths in vessels that are given start
        anew; those that stay go on.

        Raises InputError for a snapshot of another mesh, model or order, for a history that is over before the part begins
        or that stays although its clock changes, and for a support that holds the body elsewhere than it
        is.
        """
        given = {"baths": baths, "loads": loads, "supports": supports, "charge": charge}
        snapshot = end.end if isinstance(end, Result) else end
        scene = following(self, snapshot, start, {name: piece for name, piece in given.items() if piece is not None})
        after = Discretisation(scene)
        given_anew = () if baths is None else scene.baths
        fresh = [number.name for bath in given_anew for number in bath.numbers(after.concentration).values()]
        checks.set_fields(scene, origin=handed_on(snapshot, Discretisation(self), after, fresh))
        return scene

    def describe(self) -> str:
        """What this scene models: unknowns, degrees of freedom, terms; what is not listed is not computed."""
        problem = self.problem
        sizes = ", ".join(f"{name} {r.stop - r.start}" for name, r in problem.ranges.items())
        lines = [
            f"{type(self.model).__name__}, {type(self.kinematics).__name__}, order {self.model.order}, "
            f"{self.mesh.ne} elements, {problem.space.ndof} unknowns ({sizes})"
        ]
        for balance in dict.fromkeys(term.balance for term in problem.terms):
            names = [
                term.name + (f" on {term.boundary}" if term.boundary else "")
                for term in problem.terms
                if term.balance == balance
            ]
            lines.append(f"  {balance}: {', '.join(names)}")
        for bath in self.baths:
            carried = "; a porous plate carries its pressure" if bath.porous_plate else ""
            volume = product("-", power_of_mm(problem))
            vessel = "" if bath.vessel is None else f"; in a vessel of {bath.vessel.volume:g} {volume}{bath.vessel}"
            lines.append(f"  bath on {bath.boundary}: {self.treatment(bath)}{carried}{vessel}")
        for one in (one for one in self.held() if one.moves):
            how = "displaced" if one.force is None else "displaced as one by a force"
            lines.append(f"  {type(one.support).__name__} on {one.boundary}: {how} along {one.direction}")
        lines += [f"  {name}: {law}" for name, law in self.material.laws().items()]
        lines.append(f"  threads: {threads_said(problem)}")
        if not problem.team.alone:
            lines.append(f"  {problem.share.describe(problem.space)}")
            lines.append(f"  linear solver: {solver_said(problem)}")
        if self.compiled:
            missing = why_not()
            lines.append("  terms: " + ("compiled to C++" if missing is None else f"bytecode ({missing})"))
        lines += [f"  limit: {limit}" for limit in limits(self)]
        return "\n".join(lines)

    def equilibrate(
        self,
        time: float | None = None,
        solver: Callable[[Problem], LinearSolver] = solver_of,
        newton: DampedNewton | None = None,
        observers: Sequence[Observer | Callable[[float, Any], object]] = (),
        unstable: str = "warn",
    ) -> Snapshot:
        """The state of rest for the charge and baths at `time` [s] (the start), without a transient.

        `observers` record it. A state in which anything grows, however slowly, is answered as in `run` (`unstable`).
        What is done, and what cannot be: `ngswell.run.equilibrium.equilibrate`.
        """
        return equilibrate(self, time, newton, solver, observers, unstable)

    def growth_factor(
        self, dt: float, state: Snapshot | None = None, tolerance: float = 1e-6, most_steps: int = 1000
    ) -> Growth:
        """What one step of `dt` [s] does to a small perturbation; see `ngswell.analysis.one_step.growth_factor`."""
        return growth_factor(self, dt, state, tolerance, most_steps)

    def run(
        self,
        until: float,
        steps: Control | None = None,
        observers: Sequence[Observer | Callable[[float, Any], object]] = (),
        newton: DampedNewton | None = None,
        resume: Snapshot | Restart | None = None,
        solver: Callable[[Problem], LinearSolver] = solver_of,
        checkpoint: Checkpoint | None = None,
        unstable: str = "warn",
        log: str | Path | CSV | None = None,
    ) -> Result:
        """Run to `until` [s] from the start, or from the snapshot `resume` of an earlier run of this scene.

        With a `checkpoint` the run is kept in its file, and goes on from it if there is one: its observers and Result then
        cover the whole of it, and the numbers are those of a run that was not interrupted. `resume` takes what
        `read_checkpoint` gives as well. With other steps or another solver only state and records go on.

        `observers` are shown the initial state and every accepted step; a function of time [s] and state is one too.
        `solver` makes the linear solver: a direct one, or `TwoLevelSolver` for large bodies in space. `steps` are
        `Adaptive(tolerance)` or `Fixed(step)`, `newton` replaces the nonlinear solver that they ask for.

        A state past the limit of stability is answered by an InstabilityWarning, with `unstable="error"` by an
        InstabilityError, with "off" not at all: at the end where a perturbation grows by a factor e in as long as the run
        took, now and then before where one grows faster than the steps follow. `Stability` among the observers looks in its
        place, at every step.

        With `log`, a path or a `CSV`, the accepted steps are written there as they are made, and `result.steps` reads them;
        else they stay in the memory, a quarter to a kilobyte each.

        Raises InputError before any computing, OutputError when an observer cannot write, and StepError when no step
        succeeds; `end` of that error is the last accepted state. With a checkpoint, Ctrl-C and SIGTERM end the run after
        the present step.
        """
        return run(self, until, steps, observers, newton, resume, solver, checkpoint, unstable, log)


def _unpickled(pieces: bytes) -> Scene:
    return Scene(**pickle.loads(pieces))


def _misfit(value: object) -> Exception | None:
    """Why pickle does not take a value."""
    try:
        pickle.dumps(value)
    except Exception as error:
        return error
    return None
