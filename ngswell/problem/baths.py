"""Baths in the forms: the fields that they are, and the terms that weak treatments and vessels add."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ngsolve import CoefficientFunction

from ngswell.baths.bath import Bath, area
from ngswell.baths.treatment import Contact, Weak
from ngswell.mesh.sizes import cell_size
from ngswell.models.model import BathFields
from ngswell.models.one_number import Functions
from ngswell.models.term import Term
from ngswell.problem.discretisation import Discretisation
from ngswell.schedules import Clock

CONDUCTANCES = {"fluid": "K", "cations": "D_plus"}
"""The parameter that lets through what each balance is about."""


class Baths:
    """The baths of a setup at the clock's time. `functions` are those of the numbers that pieces bring, by name.

    `present` are their fields, by boundary, with what is being computed of those that are unknowns. With what gel and
    vessel have `held` together, by name of the vessel's numbers, these sums take the place of the vessel's balances.
    """

    def __init__(
        self,
        discretisation: Discretisation,
        functions: Mapping[str, Functions],
        clock: Clock,
        held: Mapping[str, float] | None,
    ) -> None:
        self._discretisation, self._functions, self._clock, self._held = discretisation, functions, clock, held
        self.present: dict[str, BathFields] = {}
        self._sought: dict[str, BathFields] = {}
        for bath in discretisation.setup.baths:
            P = clock.follow(bath.hydraulic)
            salt = None if bath.salt is None else clock.follow(bath.salt)
            sought = present = BathFields(salt, P)
            if unknown := self._own(bath).get("cations"):
                sought, present = BathFields(unknown.trial, P), BathFields(unknown.field, P)
            self.present[bath.boundary], self._sought[bath.boundary] = present, sought

    def _own(self, bath: Bath) -> dict[str, Functions]:
        """The unknowns of a bath by the balance that they face."""
        numbers = bath.numbers(self._discretisation.concentration)
        return {balance: self._functions[number.name] for balance, number in numbers.items()}

    def terms(self, state: Any, trials: Sequence[Any], tests: Sequence[Any]) -> list[Term]:
        """What weak treatments and vessels add."""
        problem = self._discretisation
        setup, kinematics = problem.setup, problem.kinematics
        own = len(problem.model.unknowns)
        terms: list[Term] = []
        for bath, treatment in setup.weak_baths:
            multipliers = list(zip(trials[own:], tests[own:], strict=True)) if treatment.multipliers else []
            terms += treatment.terms(self._contact(bath, treatment, state, tests, multipliers))
            if bath.vessel is not None:
                numbers = bath.numbers(problem.concentration)
                size = area(problem.mesh, kinematics, bath.boundary)
                on = bath.boundary, numbers, self._own(bath), size
                if self._held is None:
                    terms += bath.vessel.terms(*on, self._clock)
                else:
                    in_gel = {"fluid": state.content, "cations": state.content * state.cations}
                    terms += bath.vessel.sums(*on, in_gel, self._held)
        return terms

    def loads(self, u: CoefficientFunction, v: CoefficientFunction) -> list[Term]:
        """What baths press with."""
        problem = self._discretisation
        pressed = ((bath, self._sought[bath.boundary]) for bath in problem.setup.baths)
        return [term for bath, fields in pressed for term in bath.loads(problem.kinematics, u, v, fields)]

    def _contact(
        self, bath: Bath, treatment: Weak, state: Any, tests: Sequence[Any], multipliers: list[tuple[Any, Any]]
    ) -> Contact:
        problem = self._discretisation
        h, model = cell_size(problem.mesh, bath.boundary), problem.model
        excess = model.excess(state, self._sought[bath.boundary])
        tested: dict[str, CoefficientFunction] = {
            balance: tests[problem.names.index(unknown)] for balance, unknown in model.balanced.items()
        }
        return Contact(
            boundary=bath.boundary,
            state=state,
            excess=excess,
            tests=tested,
            multipliers=dict(zip(model.balanced, multipliers, strict=False)),
            h=h,
            order=model.order,
            conductances={name: problem.setup.material.largest(CONDUCTANCES[name], problem.mesh) / h for name in excess},
            receiving={}
            if self._held is not None
            else {balance: functions.test for balance, functions in self._own(bath).items()},
        )
