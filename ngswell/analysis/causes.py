"""Causes of a failed step beside a singular system: forces that do not balance, charge that outruns salt, lagged baths."""

from __future__ import annotations

import numpy as np
from ngsolve import CF

from ngswell.analysis.one_step import growth_factor
from ngswell.errors import Failure, NgswellError, Reason, place
from ngswell.mesh.points import vertices, vertices_of
from ngswell.models.term import Role
from ngswell.physics import donnan
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
from ngswell.solve.choice import solver_over
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.newton import DampedNewton

BALANCED = 1e-2
"""Share of the largest force that a state at rest leaves at most; Newton's tolerance leaves far less."""

SLACK = 1e-3
"""Share of the charge that is taken off beside what has risen: the last accepted state may have no anions left at all."""


def imbalance(problem: Problem) -> Failure | None:
    """What is said of forces that do not balance in the present state; None where they do.

    Loads, if they are the larger part of what is left, else the pressure of the charge.
    """
    left, where, loaded = forces_left(problem)
    if left <= BALANCED:
        return None
    said = f"the forces on the body leave {left:.0%} of the largest of them, most near {place(where)} mm"
    return Failure(Reason.LOADED_AT_ONCE if loaded else Reason.OUT_OF_BALANCE, "u", where, said)


def released(problem: Problem, snapshot: Snapshot) -> Failure | None:
    """What is said of forces that did not balance at the scene's start, where nothing but the body has moved since then."""
    setup = problem.setup
    for history in setup.schedules:
        if not history.uniform or history.at(setup.start) != history.at(snapshot.time):
            return None
    problem.restore(Snapshot(setup.start, problem.initial))
    found = imbalance(problem)
    problem.restore(snapshot)
    return found


def forces_left(problem: Problem) -> tuple[float, tuple[float, ...], bool]:
    """What the forces of the present state leave at the displacements that are free, as a share of the largest of them; the
    vertex [mm] where it is largest: at rest, what Newton's method leaves; and whether loads are more than the rest."""
    force = problem.fields.vec.CreateVector()
    u = problem.ranges[problem.names[0]]
    free = np.array(list(problem.free), dtype=float)[u]
    for tie in problem.ties:
        free[tie.dofs[0]] = 1.0
    left, largest, loads = np.zeros(problem.vector.size), 0.0, np.zeros(problem.vector.size)
    for term in problem.terms:
        problem.form([term], 0.0).apply(force)
        share = force.FV().NumPy()[u].copy()
        for tie in problem.ties:
            share[tie.dofs[0]] = share[tie.dofs].sum()
        share *= free
        left[u] += share
        largest = max(largest, float(np.abs(share).max()))
        if term.role is Role.LOAD:
            loads[u] += share
    for tie in problem.ties:
        pushed = tie.force.at(problem.time)
        left[tie.dofs[0]] -= pushed
        loads[tie.dofs[0]] -= pushed
        largest = max(largest, abs(pushed))
    loaded = bool(np.abs(loads).max() > np.abs(left - loads).max())
    return (float(np.abs(left).max()) / largest if largest else 0.0), problem.worst(left)[1], loaded


def outrun(problem: Problem, snapshot: Snapshot, dt: float, failure: Failure) -> Failure | None:
    """Whether the charge rises faster than salt diffuses in: the step of `dt` [s] that failed succeeds with the charge held.

    Salt takes T = cfc/(2 c₋) L²/D to a place L from the bath: there the charge may rise by D c₋/(L²/2) in unit time, for the
    anions c₋ that are left at rest with the highest charge cfc and the lowest bath.
    """
    setup, time = problem.setup, snapshot.time
    now, then = setup.charge.at(time), setup.charge.at(time + dt)
    if not abs(then) > abs(now):
        return None
    if not setup.baths:
        said = "no bath gives any"
    else:
        problem.restore(snapshot)
        problem.begin_step(time + dt, dt, charge_share=(1 - SLACK) * now / then)
        outcome = DampedNewton().solve(problem, Factorisation(solver_over(problem, None)))
        problem.restore(snapshot)
        if outcome.failure is not None:
            return None
        said = f"that takes some {float(f'{salt_time(problem):.2g}'):g} s here"
    return Failure(Reason.CHARGE_OUTRUNS_SALT, failure.field, failure.where, said)


SPENT = 1e-2
"""Share of the anions of a state of rest below which hardly any are left."""


def anions_are_spent(problem: Problem) -> bool:
    """Whether somewhere hardly any anions are left of those at rest with the highest charge and the lowest bath."""
    outputs = problem.state.outputs()
    if "c_minus" not in outputs or not problem.setup.baths:
        return False
    return bool(outputs["c_minus"](problem.points).min() < SPENT * _anions_at_rest(problem)[1])


def _anions_at_rest(problem: Problem) -> tuple[float, float]:
    """The highest charge, and the anions beside it at rest in the lowest bath [mol/l]."""
    setup, cfc = problem.setup, problem.largest_charge
    salt = min(value for bath in setup.baths if bath.salt is not None for value in bath.salt.values)
    return cfc, float(donnan.anions(salt, cfc, setup.material.Gamma))


def salt_time(problem: Problem) -> float:
    """T of `outrun` [s]."""
    setup, places = problem.setup, vertices(problem.mesh)
    wet = [sorted(vertices_of(problem.mesh, bath.boundary)) for bath in setup.baths]
    far = max(min(float(np.linalg.norm(places[numbers] - place, axis=1).min()) for numbers in wet) for place in places)
    D_plus, D_minus = setup.material.diffusivities
    D = CF(2 * D_plus * D_minus / (D_plus + D_minus))(problem.points).min()
    cfc, anions = _anions_at_rest(problem)
    return cfc / (2 * anions) * far**2 / float(D)


def oscillating(problem: Problem, snapshot: Snapshot, dt: float) -> Failure | None:
    """What a step of `dt` [s] from `snapshot` multiplies a perturbation by if a bath looks back; None unless it grows."""
    try:
        growth = growth_factor(problem.setup, dt, snapshot)
    except NgswellError:
        return None
    if abs(growth.factor) <= 1:
        return None
    field, where = problem.worst(growth.mode.vec.FV().NumPy())
    said = f"a step of {dt:.3g} s multiplies perturbations by {growth.factor:.3g}"
    return Failure(Reason.OSCILLATES, field, where, said)
