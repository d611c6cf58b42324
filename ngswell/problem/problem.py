"""The discrete problem of a setup: its terms and forms, the clock they follow, and the equations of one step or stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from ngsolve import CF, BaseMatrix, BaseVector, CoefficientFunction, GridFunction, Parameter
from numpy.typing import NDArray

from ngswell.baths.treatment import Charge
from ngswell.mesh.points import corners
from ngswell.models.model import BathFields, FieldContext
from ngswell.models.one_number import Functions
from ngswell.models.term import Kind, Term
from ngswell.problem.admissible import Admissible
from ngswell.problem.baths import Baths
from ngswell.problem.body import Unknowns
from ngswell.problem.bounded import set_bounded
from ngswell.problem.discretisation import Discretisation
from ngswell.problem.forms import Form
from ngswell.problem.prescribed import PrescribedValues
from ngswell.schedules import Clock
from ngswell.setup.loads import followed
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot

LEFT = 0.1
"""What a correction leaves at least of what has to be positive at a vertex."""


class Problem(Discretisation):
    """The equations of one step of backward Euler, or of one stage of a Runge–Kutta step:

        r(x) = [S(x) − S(x_old)] / Δt + R(x) = 0,

    S the contents (terms of kind RATE), R everything else. S(x_old) is a vector computed once a step, so no form sees an
    old state. Linearisations are NGSolve's. The fields of a problem are those of what is being computed with it; results
    are snapshots. What gel and vessels have `held` together stays, if it is given (for states of rest).
    """

    def __init__(self, setup: Setup, held: Mapping[str, float] | None = None) -> None:
        super().__init__(setup)
        self.fields = GridFunction(self.space)
        self.dt = Parameter(1.0)
        self.clock = Clock(setup.start)
        self._charge = Parameter(setup.charge.at(setup.start))
        own = len(self.model.unknowns)  # the rest are multipliers and numbers
        trials, tests = (list(functions) for functions in self.space.TnT())
        self._unknowns = Unknowns(trials, tests, self.fields)
        numbers = {
            name: Functions(trials[at], tests[at], self.fields.components[at])
            for at, name in enumerate(self.names)
            if name in self.numbers
        }
        baths = Baths(self, numbers, self.clock, held)
        self.baths = baths.present
        """The baths at the clock's time, by boundary."""
        weight = None if setup.fluid_weight is None else followed(setup.fluid_weight, self.clock)
        context = FieldContext(setup.material, self.kinematics, self._charge, weight, next(iter(self.baths.values()), None))
        trial_state = self.model.state(trials[:own], context)
        self.state = self.model.state(self.fields.components[:own], context)
        tested = {balance: tests[self.names.index(unknown)] for balance, unknown in self.model.balanced.items()}
        self.terms: list[Term] = [
            *self.model.terms(trial_state, tests[:own]),
            *baths.terms(trial_state, trials, tests),
            *(term for load in setup.loads for term in load.terms(trial_state, tests[0], self.clock)),
            *(term for load in setup.loads for term in load.flows(tested, self.clock)),
            *baths.loads(trial_state.u, tests[0]),
        ]
        self.admissible = Admissible(self, self.state, self.fields)
        self._prescribed = PrescribedValues(self, self.fields, self.baths)
        self._system = self.form(self.terms, 1 / self.dt, often=True)
        self._contents = self.form([term for term in self.terms if term.kind is Kind.RATE])
        self._old_contents, self._work = (self.fields.vec.CreateVector() for _ in range(2))

    def form(self, terms: Sequence[Term], rates: Any = None, condense: bool = False, often: bool = False) -> Form:
        """`terms` as a form of the fields; one that is evaluated `often` is compiled as the setup says."""
        return Form(self, self._unknowns, terms, rates, condense, often)

    # -- clock and states ----------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time of the clock [s]."""
        return self.clock.time

    @property
    def vector(self) -> NDArray:
        """All coefficients, as a numpy view."""
        return self.fields.vec.FV().NumPy()

    def set_time(self, time: float, charge_share: float = 1.0) -> None:
        """Move every history to `time` [s]; `charge_share` of the charge, for continuation."""
        self.clock.set(time)
        self._charge.Set(charge_share * self.setup.charge.at(time))

    def initialise(self, charge_share: float = 1.0) -> None:
        """The reference configuration in Donnan equilibrium with the initial bath, at the setup's start."""
        self.set_time(self.setup.start, charge_share)
        salt, hydraulic = self.setup.initial_bath()
        bath = BathFields(None if salt is None else CF(salt), CF(hydraulic))
        cfc = self._charge * self.setup.material.cfc0
        values = self.model.equilibrium(bath, cfc, self.setup.material)
        if self.model.charge_field is not None:
            values[self.model.charge_field] = cfc
        self.fields.vec[:] = 0.0
        uniform = not any(isinstance(value, CoefficientFunction) for value in (salt, hydraulic))
        for name, value in values.items():
            field = self.fields.components[self.names.index(name)]
            field.Set(value) if uniform else set_bounded(field, value)
        for name, number in self.numbers.items():
            self.vector[self.ranges[name]] = number.start
        self._prescribed.remember(Charge.START)
        self.initial = self.vector.copy()

    def snapshot(self, time: float) -> Snapshot:
        """The present fields, as those at `time` [s]."""
        return Snapshot(time, self.vector.copy(), self.meaning)

    def restore(self, snapshot: Snapshot) -> None:
        """Put the fields and the clock back to a snapshot. Raises InputError for one of another discretisation."""
        self.check("restore", snapshot)
        self.set_time(snapshot.time)
        self.vector[:] = snapshot.values

    # -- steps ---------------------------------------------------------------------------------------------------------

    @cached_property
    def lumps(self) -> bool:
        """Whether there are contents that may be lumped."""
        return any(term.lumps for term in self.terms)

    def carried(self, lumped: bool) -> NDArray:
        """S at the present fields, with contents `lumped` or not from now on: what the vertices hold stays what it is."""
        self.contents(self._work)
        before = self._work.FV().NumPy().copy()
        if lumped == self.storage.is_lumped:
            return before
        self.storage.lump(lumped)
        self.contents(self._work)
        return np.where(self._beyond_vertices, self._work.FV().NumPy(), before)

    def held(self, rates: NDArray) -> NDArray:
        """`rates` of contents, without those of functions that hold nothing while contents are lumped."""
        return np.where(self._beyond_vertices, 0.0, rates) if self.storage.is_lumped and rates.size else rates

    @cached_property
    def _beyond_vertices(self) -> NDArray:
        """Which coefficients hold nothing while contents are lumped."""
        found = np.zeros(self.space.ndof, dtype=bool)
        for balance in {term.balance for term in self.terms if term.lumps}:
            found[self.ranges[self.model.balanced[balance]]][self.mesh.nv :] = True
        return found

    def begin_step(
        self,
        time: float,
        dt: float,
        guess: NDArray | None = None,
        charge_share: float = 1.0,
        old_contents: NDArray | None = None,
    ) -> None:
        """Prepare the step of backward Euler from the fields to `time`; `guess` as first iterate.

        `old_contents` are those of the fields unless they are `carried` over a change of how they are integrated. The
        prescribed values are not put into the fields: see `gap`.
        """
        self._old_contents.FV().NumPy()[:] = self.carried(self.storage.is_lumped) if old_contents is None else old_contents
        self._prescribed.remember(Charge.LAST_STEP)
        self._begin(time, dt, guess, charge_share)

    def begin_stage(self, time: float, dt: float, old_contents: NDArray, guess: NDArray) -> None:
        """Prepare a stage of a Runge–Kutta step: like a step of backward Euler of size `dt` from `old_contents`."""
        self._old_contents.FV().NumPy()[:] = old_contents
        self._begin(time, dt, guess)

    def _begin(self, time: float, dt: float, guess: NDArray | None, charge_share: float = 1.0) -> None:
        self.dt.Set(dt)
        self.set_time(time, charge_share)
        self._prescribed.update(time)
        if guess is not None:
            self.vector[:] = guess
            self.vector[self._still] = 0.0  # no correction sees it, and extrapolation would let round-off grow

    def keep_positive(self, start: NDArray) -> None:
        """Where a vertex has lost all of an unknown that is positive, a part of its value at `start`, or of round-off's.

        Next to nothing dr/dx is singular to round-off, and what it says of such a vertex must not hold up all the others.
        """
        for name in self.model.positive:
            part = slice(self.ranges[name].start, self.ranges[name].start + self.mesh.nv)
            least = np.maximum(start[part], self.round_off[name])
            self.vector[part] = np.where(self.vector[part] > 0, self.vector[part], LEFT * least)

    def from_above(self, vector: NDArray) -> NDArray:
        """`vector` with what has to be positive as high everywhere as in the strongest bath at the clock's time."""
        guess, places = vector.copy(), corners(self.mesh)
        for name in self.model.positive if self.baths else ():
            guess[self.ranges[name]] = 0.0
            guess[self.ranges[name].start :][: self.mesh.nv] = max(np.max(bath.salt(places)) for bath in self.baths.values())
        return guess

    def gap(self) -> NDArray:
        """What the fields exceed the prescribed values by, where there are any; zero elsewhere."""
        return self._prescribed.gap(self.vector)

    def residual(self, result: BaseVector) -> None:
        """r at the present fields, on all degrees of freedom (constrained ones hold reactions).

        Where a force moves a side as one, the sum of the reactions and less the force is what has to vanish.
        """
        self._system.apply(result)
        result.data -= (1 / self.dt.Get()) * self._old_contents
        for tie in self.ties:
            result[int(tie.dofs[0])] -= tie.force.at(self.time)

    def linearise(self) -> BaseMatrix:
        """dr/dx at the present fields, on all degrees of freedom."""
        return self._system.linearise()

    @property
    def reaches_inside(self) -> bool:
        """Whether terms on cell sides take normal derivatives, from outside what static condensation eliminates."""
        return any(term.normal_derivatives for term in self.terms)

    @cached_property
    def kinked(self) -> bool:
        """Whether dr/dx jumps somewhere."""
        return any(term.kinked for term in self.terms)

    @cached_property
    def condensed(self) -> Form | None:
        """The system without the unknowns inside cells, to be assembled like `linearise`; None where it gains nothing."""
        inside = sum(self.space.FreeDofs()) - sum(self.space.FreeDofs(True))
        if not inside or self.reaches_inside:
            return None
        return self.form(self.terms, 1 / self.dt, condense=True, often=True)

    def contents(self, result: BaseVector) -> None:
        """S at the present fields: its sum over the vertex functions of p or c is the fluid or the salt held."""
        self._contents.apply(result)

    def outflow(self, result: BaseVector) -> None:
        """R at the present fields and time, which the contents fall by in unit time, on all degrees of freedom."""
        self._system.apply(result)
        self._contents.apply(self._work)
        result.data -= (1 / self.dt.Get()) * self._work
