"""A scene: mesh, kinematics, material, model, supports, baths and loads, checked and run."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter

import numpy as np
from ngsolve import VOL, CoefficientFunction, FESpace, Mesh, TaskManager, specialcf
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ngswell import checks
from ngswell.analysis.diagnosis import cannot_change_volume, connected_parts, free_motion
from ngswell.baths.bath import Bath, Lagged, Multiplier, Treatment, Weak
from ngswell.checks import shown
from ngswell.errors import InputError
from ngswell.mesh.points import points, vertices, vertices_of
from ngswell.mesh.shapes import check_mesh
from ngswell.models.model import Model
from ngswell.models.potential import Potential
from ngswell.observers.base import Observer
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material
from ngswell.problem.problem import Problem, Snapshot
from ngswell.run.checkpoint import Checkpoint, Signals, Stopped
from ngswell.run.equilibrium import equilibrate
from ngswell.run.restart import Restart, parts, text_of, versions
from ngswell.schedules import LARGEST, Blend, Ramp
from ngswell.setup.supports import Load, Pin, Roller, Support, Symmetry, Traction, Weight
from ngswell.solve.direct import LinearSolver, solver_of
from ngswell.solve.newton import Newton
from ngswell.stepping.schemes import BACKWARD_EULER
from ngswell.stepping.stepper import Adaptive, Control, Stepper, StepReport, resolution, same_time, why


@dataclass(frozen=True)
class Result:
    """What a run did: its accepted steps, and the state it ended in. Numbers of interest are kept by the observers."""

    steps: tuple[StepReport, ...]
    end: Snapshot
    seconds: float
    factorisations: int
    solves: int

    @property
    def iterations(self) -> int:
        """Newton iterations of all accepted steps."""
        return sum(step.iterations for step in self.steps)

    @property
    def rejections(self) -> int:
        """Rejected steps."""
        return sum(len(step.rejected) for step in self.steps)

    def summary(self) -> str:
        """What the run took, and why steps were rejected."""
        done = f"{len(self.steps)} steps, {self.iterations} Newton iterations, {self.seconds:.1f} s"
        reasons = why(text for step in self.steps for text in step.rejected)
        return f"t = {self.end.time:.10g} s after {done}" + (f"; rejected: {reasons}" if reasons else "")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """An initial boundary-value problem of a swelling body. Units mm, N, s, K, mol/l throughout.

    The body starts undeformed, in Donnan equilibrium with `initial` (salt concentration [mol/l] and hydraulic
    pressure [N/mm²]; by default that of its baths at `start`, which then have to agree). `charge` multiplies the
    material's cfc0 over time. Raises InputError for anything that cannot be meant.
    """

    mesh: Mesh
    kinematics: Kinematics
    material: Material
    model: Model = Potential()
    supports: Sequence[Support] = ()
    baths: Sequence[Bath] = ()
    loads: Sequence[Load] = ()
    charge: Ramp = Ramp((0.0, 1.0))
    start: float = 0.0  # [s]
    initial: tuple[float | None, float] | None = None

    def __post_init__(self) -> None:
        self._check_kinds()
        if self.kinematics.dimension != self.mesh.dim:
            raise InputError(
                f"{type(self.kinematics).__name__} needs a {self.kinematics.dimension}-d mesh, this one is {self.mesh.dim}-d"
            )
        check_mesh(self.mesh)
        self.material.check_on(self.mesh)
        self.model.check(self.material, self.baths)
        for value in self.charge.values:
            if not 0 <= value <= 100:
                raise InputError(f"charge factor {value!r} is outside 0 … 100; it multiplies cfc0")
        self._check_baths()
        self._check_supports()
        self._check_loads()
        self.initial_bath()

    def _check_kinds(self) -> None:
        """Refuse pieces that are none of their kind; lists become tuples."""
        checks.instance("mesh", self.mesh, Mesh, "a mesh of NGSolve, as column, rectangle, box, from_occ and read_mesh make")
        motions = "Confined(), PlaneStrain(), Axisymmetric() or Solid()"
        checks.instance("kinematics", self.kinematics, Kinematics, motions)
        checks.instance("material", self.material, Material, "a Material(...)")
        models = "Potential(), Concentration(), LocalDonnan() or Uncharged()"
        checks.instance("model", self.model, Model, models)
        checks.instance("charge", self.charge, Ramp, "a Ramp of factors on cfc0, such as Ramp((0, 0.0), (4000, 1.0))")
        checks.settle(
            self,
            supports=checks.several("supports", self.supports, Support, "Roller, Symmetry or Pin"),
            baths=checks.several("baths", self.baths, Bath, "Bath(...)"),
            loads=checks.several("loads", self.loads, Load, "Traction or Weight"),
            start=checks.number("start", self.start, "s", -LARGEST, LARGEST),
        )
        if self.initial is not None:
            initial = checks.entries(self.initial)
            if initial is None or len(initial) != 2:
                pair = "(concentration [mol/l], hydraulic pressure [N/mm²])"
                raise InputError(f"initial has to be {pair}, got {shown(self.initial)}")
            salt, hydraulic = initial
            if salt is not None:
                salt = checks.number("initial: concentration", salt, "mol/l")
            checks.settle(self, initial=(salt, checks.number("initial: hydraulic pressure", hydraulic, "N/mm²")))

    # -- checks --------------------------------------------------------------------------------------------------------

    def check_boundary(self, what: str, boundary: str) -> list[str]:
        known = sorted(set(self.mesh.GetBoundaries()))
        names = boundary.split("|")
        for name in names:
            if name not in known:
                raise InputError(f"{what}: the mesh has no boundary {name!r}; it has {', '.join(known)}")
            if re.escape(name) != name:
                raise InputError(f"{what}: boundary {name!r} has characters that NGSolve reads as a pattern; rename it")
        return names

    def _check_directions(self, what: str, directions: str) -> None:
        if not directions or any(d not in self.kinematics.directions for d in directions):
            choices = ", ".join(self.kinematics.directions)
            raise InputError(f"{what}: direction {directions!r} is none of {choices} (or several of them)")

    def _check_baths(self) -> None:
        held: set[str] = set()
        for bath in self.baths:
            for name in self.check_boundary("bath", bath.boundary):
                if name in held:
                    raise InputError(f"bath on {bath.boundary!r}: boundary {name!r} already has a bath")
                held.add(name)
            for history in bath.schedules:
                if isinstance(history, Blend):
                    region = VOL if self.mesh.dim == 1 else self.mesh.Boundaries(bath.boundary)  # an end has no points
                    history.check_on(points(self.mesh, region, 4))
            if not isinstance(self.treatment(bath), self.model.treatments):
                choices = ", ".join(t.__name__ for t in self.model.treatments)
                model = type(self.model).__name__
                raise InputError(f"bath on {bath.boundary!r}: {model} has no {bath.treatment!r}; it has {choices}")
        self._check_multipliers()

    def _check_multipliers(self) -> None:
        """Refuse a bath that prescribes values in vertices where multipliers impose theirs: the system would be singular."""
        prescribed = [bath for bath in self.baths if not isinstance(self.treatment(bath), Weak)]
        for bath in self.baths:
            for other in prescribed if isinstance(self.treatment(bath), Multiplier) else []:
                if vertices_of(self.mesh, bath.boundary) & vertices_of(self.mesh, other.boundary):
                    raise InputError(
                        f"baths on {bath.boundary!r} and {other.boundary!r} touch: {self.treatment(bath)!r} would impose "
                        f"there what {self.treatment(other)!r} prescribes; beside it take Penalty, Nitsche or Multiplier"
                    )

    def _check_supports(self) -> None:
        bath_boundaries = {name for bath in self.baths for name in bath.boundary.split("|")}
        for support in self.supports:
            what = type(support).__name__
            if isinstance(support, Pin):
                self._check_directions(what, support.direction)
                self._vertex(support)
                continue
            names = self.check_boundary(what, support.boundary)
            if isinstance(support, Roller):
                self._check_directions(what, support.direction)
            else:
                self._normal_direction(support)
                for name in names:
                    if name in bath_boundaries:
                        raise InputError(f"Symmetry on {name!r}: it has a bath, but nothing flows through a symmetry plane")
        self.kinematics.check(self.mesh, self.held())
        self._check_parts()

    def _check_loads(self) -> None:
        held = self.held()
        for load in self.loads:
            vectors = (load.vector,) if isinstance(load, Traction) else (load.fluid, load.solid)
            for vector in vectors:
                if len(vector) != self.mesh.dim:
                    raise InputError(f"{type(load).__name__}: {vector} needs {self.mesh.dim} components")
            if isinstance(load, Traction):
                names = self.check_boundary("Traction", load.boundary)
                for direction, value in zip(self.kinematics.directions, load.vector, strict=True):
                    for name in names:
                        if value and name in held[direction].split("|"):
                            raise InputError(f"Traction on {name!r}: a support holds it in {direction}, so it has no effect")
        if sum(isinstance(load, Weight) for load in self.loads) > 1:
            raise InputError("loads hold more than one Weight; add the vectors up")

    def _check_parts(self) -> None:
        """Refuse parts of the body that are free to translate or rotate, or whose pressure has no level."""
        places, held, bodies = vertices(self.mesh), self.held(), connected_parts(self.mesh)
        self._check_separate(places, bodies)
        fixed = {
            (number, axis)
            for axis, direction in enumerate(self.kinematics.directions)
            for name in held[direction].split("|")
            if name
            for number in vertices_of(self.mesh, name)
        }
        fixed |= {
            (self._vertex(pin), self.kinematics.directions.index(direction))
            for pin in self.supports
            if isinstance(pin, Pin)
            for direction in pin.direction
        }
        wet = {number for bath in self.baths for number in vertices_of(self.mesh, bath.boundary)}
        for body in bodies:
            place = ", ".join(f"{x:.4g}" for x in places[body].mean(axis=0))
            what = "the body" if len(bodies) == 1 else f"the part near ({place}) mm, one of {len(bodies)} not connected,"
            number_in_part = {int(number): index for index, number in enumerate(body)}
            mine = [(number_in_part[number], axis) for number, axis in sorted(fixed) if number in number_in_part]
            motion = free_motion(self.kinematics, places[body], mine)
            if motion:
                raise InputError(f"{what} can {motion}: add a Roller, Symmetry or Pin")
            if wet.isdisjoint(number_in_part) and cannot_change_volume(self.mesh, self.kinematics, held, body):
                raise InputError(
                    f"{what} has no bath and is held on all sides, so nothing determines the level of its pressure: "
                    "give it a bath, or leave a side free"
                )

    def _check_separate(self, places: NDArray, bodies: list[NDArray]) -> None:
        """Refuse parts that touch without sharing vertices: they would not know of each other."""
        size = float(np.ptp(places, axis=0).max())
        seen: dict[tuple[int, ...], int] = {}
        for index, body in enumerate(bodies if len(bodies) > 1 else []):
            for number in body:
                key = tuple(np.round(places[number] / (1e-9 * size)).astype(int).tolist())
                if seen.setdefault(key, index) != index:
                    place = ", ".join(f"{x:.4g}" for x in places[number])
                    raise InputError(
                        f"mesh: two parts that are not connected touch near ({place}) mm: merge their vertices "
                        "(Glue in netgen.occ, Coherence in Gmsh)"
                    )

    def _vertex(self, pin: Pin) -> int:
        places = vertices(self.mesh)
        if len(pin.point) != self.mesh.dim:
            raise InputError(f"Pin at {pin.point} needs {self.mesh.dim} coordinates [mm]")
        distances = np.linalg.norm(places - np.array(pin.point), axis=1)
        nearest = int(np.argmin(distances))
        if distances[nearest] > 1e-9 * max(1.0, float(np.abs(places).max())):
            raise InputError(f"Pin at {pin.point}: no mesh vertex there; the nearest is {tuple(places[nearest])}")
        return nearest

    def _normal_direction(self, support: Symmetry) -> str:
        region = self.mesh.Boundaries(support.boundary)
        normals = np.abs(specialcf.normal(self.mesh.dim)(points(self.mesh, region, 2)))
        axis = int(np.argmax(normals[0]))
        if normals[:, axis].min() < 1 - 1e-9:
            raise InputError(f"Symmetry on {support.boundary!r}: the boundary is not straight along an axis")
        return self.kinematics.directions[axis]

    def _check_scheme(self, control: Control) -> None:
        for bath in self.baths:
            if isinstance(self.treatment(bath), Lagged) and control.scheme is not BACKWARD_EULER:
                raise InputError(
                    f"bath on {bath.boundary!r}, {self.treatment(bath)}: that is a condition of backward Euler, not of "
                    f"{control.scheme}; run with steps={type(control).__name__}(..., scheme=BACKWARD_EULER)"
                )

    # -- what models and problems ask ----------------------------------------------------------------------------------

    def held(self) -> dict[str, str]:
        """Boundaries ("a|b") on which each displacement component vanishes."""
        boundaries: dict[str, list[str]] = {direction: [] for direction in self.kinematics.directions}
        for support in self.supports:
            if isinstance(support, Roller):
                for direction in support.direction:
                    boundaries[direction].append(support.boundary)
            elif isinstance(support, Symmetry):
                boundaries[self._normal_direction(support)].append(support.boundary)
        return {direction: "|".join(names) for direction, names in boundaries.items()}

    def pinned_dofs(self, space: FESpace) -> list[int]:
        """Degrees of freedom of the displacement space that pins hold."""
        per_component = space.ndof // len(self.kinematics.directions)
        return [
            self.kinematics.directions.index(direction) * per_component + self._vertex(pin)
            for pin in self.supports
            if isinstance(pin, Pin)
            for direction in pin.direction
        ]

    def treatment(self, bath: Bath) -> Treatment:
        """How equilibrium with `bath` is imposed: as it says, or by the model's default."""
        return self.model.default_treatment() if bath.treatment is None else bath.treatment

    def initial_bath(self) -> tuple[CoefficientFunction | float | None, CoefficientFunction | float]:
        """Salt concentration [mol/l] and hydraulic pressure [N/mm²] that the initial state is in equilibrium with."""
        if self.initial is not None:
            Bath("initial", *self.initial)
            if self.initial[0] is None and "cations" in self.model.held:
                raise InputError(f"initial: {type(self.model).__name__} needs a salt concentration [mol/l], got None")
            return self.initial
        if not self.baths:
            raise InputError("the scene has no bath: give initial=(concentration, hydraulic pressure)")
        first = self.baths[0]
        for bath in self.baths[1:]:
            if [s.at(self.start) for s in bath.schedules] != [s.at(self.start) for s in first.schedules]:
                raise InputError(
                    f"baths on {first.boundary!r} and {bath.boundary!r} differ at the start: "
                    "give initial=(concentration, hydraulic pressure)"
                )
        return (first.concentration.at(self.start) if first.concentration else None), first.pressure.at(self.start)

    @cached_property
    def problem(self) -> Problem:
        """The discrete problem, made once. Its fields are those of the last run."""
        return Problem(self)

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
            lines.append(f"  bath on {bath.boundary}: {self.treatment(bath)}")
        lines += [f"  {name}: {law}" for name, law in self.material.laws().items()]
        return "\n".join(lines)

    # -- running -------------------------------------------------------------------------------------------------------

    def equilibrate(self, time: float | None = None, solver: Callable[[Problem], LinearSolver] = solver_of) -> Snapshot:
        """The state of rest for the charge and baths at `time` [s] (the start), without a transient; see `equilibrate`."""
        return equilibrate(self, time, make_solver=solver)

    def run(
        self,
        until: float,
        steps: Control | None = None,
        observers: Sequence[Observer] = (),
        newton: Newton | None = None,
        resume: Snapshot | Restart | None = None,
        solver: Callable[[Problem], LinearSolver] = solver_of,
    ) -> Result:
        """Run to `until` [s] from the start, or from the snapshot `resume` of an earlier run of this scene.

        With a `Restart` (`read_checkpoint`) the earlier run goes on, and its observers and Result cover the whole of it;
        the numbers are those of a run that was not interrupted. With other steps or another solver only its state and
        records go on.

        `solver` makes the linear solver: a direct one, or `TwoLevelSolver` for large bodies in space.

        Raises InputError before any computing, OutputError when an observer cannot write, and StepError when no step
        succeeds. However a run ends, the problem's fields hold the last accepted state; with a `Checkpoint` among the
        observers, Ctrl-C and SIGTERM end it after the present step.
        """
        if resume is not None:
            checks.instance(
                "resume", resume, (Snapshot, Restart), "a snapshot, such as `end` of an earlier result, or a checkpoint"
            )
        restart = resume if isinstance(resume, Restart) else None
        state = resume.snapshot if isinstance(resume, Restart) else resume
        time = self.start if state is None else state.time
        begin = time if restart is None else restart.begin
        until = checks.number("until", until, "s", -LARGEST, LARGEST)
        if not begin < until or same_time(begin, until):
            raise InputError(f"until = {until:.17g} s is not a time after the start at {begin:.17g} s")
        if not time <= until:
            raise InputError(f"until = {until:g} s is before the checkpoint, {time:g} s")
        control = Adaptive() if steps is None else steps
        checks.instance("steps", control, Control, "Adaptive(tolerance) or Fixed(step)")
        first = control.first(until - begin, None)
        if first < resolution(until - begin, begin, until):
            raise InputError(
                f"steps: {control} starts with {first:g} s, which is lost in the round-off of a run from {begin:g} to "
                f"{until:g} s; take longer steps or a larger tolerance"
            )
        observers = checks.several("observers", observers, Observer, "observers, such as Probe(...)")
        if newton is not None:
            checks.instance("newton", newton, Newton, "a Newton(...)")
        if not callable(solver):
            raise InputError(f"solver has to make a linear solver of a problem, such as TwoLevelSolver, got {shown(solver)}")
        self._check_scheme(control)
        checkpoints = [observer for observer in observers if isinstance(observer, Checkpoint)]
        observers = [*(o for o in observers if not isinstance(o, Checkpoint)), *checkpoints]  # these see the others' records
        if restart is not None:
            restart.check(self, observers)
        problem = self.problem
        if state is not None and state.values.shape != problem.vector.shape:
            raise InputError(f"resume: the snapshot has {state.values.size} unknowns, the scene {problem.vector.size}")
        schedules = [self.charge, *(s for bath in self.baths for s in bath.schedules)]
        kinks = sorted({k for schedule in schedules for k in schedule.kinks if begin < k < until} | {begin, until})
        stops = sorted({s for observer in observers for s in observer.times(begin, until)})
        problem.initialise()
        if state is not None:
            problem.restore(state)
        accepted = problem.snapshot(time)
        reports = [] if restart is None else list(restart.steps)
        clock = perf_counter() - (0.0 if restart is None else restart.seconds)
        with TaskManager(), threadpool_limits(1, user_api="blas"), Signals(guarded=bool(checkpoints)) as signals:
            started: list[Observer] = []
            try:
                scene_parts = parts(self) if checkpoints else {}

                def present() -> Restart:
                    remembered = tuple((repr(o), {"time": o.time, **o.memory()}) for o in observers if o.remembers)
                    seconds, steps = perf_counter() - clock, tuple(reports)
                    return Restart(accepted, begin, steps, seconds, memory, remembered, method, scene_parts, versions())

                memories = iter(() if restart is None else restart.observers)
                for checkpoint in checkpoints:
                    checkpoint.follow(present, restart)
                for observer in observers:
                    if restart is not None and observer.remembers:
                        observer.resume(problem, begin, until, next(memories)[1])
                    else:
                        observer.start(problem, time, until)
                    started.append(observer)
                linear = solver(problem)
                checks.instance("what solver makes", linear, LinearSolver, "a LinearSolver, as TwoLevelSolver")
                stepper = Stepper(problem, control, newton or control.newton, linear)
                method = (
                    ""
                    if restart is None and not checkpoints
                    else text_of((control, stepper.newton, type(stepper.solver).__name__, stepper.solver.name))
                )
                if restart is not None:
                    stepper.remember(restart.stepper, same=restart.method == method)
                memory = stepper.memory()
                for checkpoint in checkpoints:
                    checkpoint.save()
                while time < until and signals.received is None:
                    signals.stepping = True
                    report = stepper.advance(time, kinks, stops)
                    signals.stepping = False
                    time = report.time
                    accepted, memory = problem.snapshot(time), stepper.memory()
                    reports.append(report)
                    for observer in observers:
                        observer.observe(problem, report)
                for checkpoint in checkpoints:
                    checkpoint.save()
            except BaseException as error:
                problem.restore(accepted)
                if signals.stepping:  # observers agree with the last accepted step
                    for checkpoint in checkpoints:
                        checkpoint.save()
                if not isinstance(error, Stopped):
                    raise
            finally:
                for observer in started:
                    observer.finish(problem)
        signals.end(time, [checkpoint.path for checkpoint in checkpoints])
        seconds = perf_counter() - clock
        return Result(tuple(reports), accepted, seconds, stepper.solver.factorisations, stepper.solver.solves)
