"""What else ranks do together, by name: observers, states of rest, looks at stability, failures, parts of a test."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from ngswell import (
    BACKWARD_EULER,
    TABLE_2,
    Adaptive,
    Area,
    Bath,
    Coarseness,
    Concentration,
    ExtrapolationWarning,
    FibreReinforced,
    Fibres,
    Fixed,
    Frozen,
    InnerLayer,
    InstabilityWarning,
    Integral,
    Lagged,
    Ledger,
    Material,
    NeoHookean,
    Outflow,
    Potential,
    Probe,
    Ramp,
    Reaction,
    Stability,
    StepError,
    Vessel,
    rectangle,
)
from ngswell.solve.rows import Rows
from tests.ranks.scenes import SCENES, cube
from tests.scenes import FALLING, quarter, strip


def observers() -> dict[str, Any]:
    """Every observer that records numbers, in one run in the plane."""
    watched = {
        "probe": Probe((0.01, 0.22), "J", "p", "stress"),
        "between": Probe((0.01, 0.22), "J", when=[3.0, 17.0], dense=True),
        "volume": Integral(),
        "on a side": Integral("p", "top"),
        "area": Area(),
        "outflow": Outflow("top"),
        "reaction": Reaction("bottom"),
        "ledger": Ledger(),
        "coarseness": Coarseness(),
        "stability": Stability(),
    }
    strip(None, FALLING, (2, 10), model=Potential(), ranks=True).run(40.0, Adaptive(1e-2), list(watched.values()))
    found = {f"{name}: {column}": values for name, one in watched.items() for column, values in one.table().items()}
    found["cells"] = watched["coarseness"].cells
    return found


def rest() -> dict[str, Any]:
    """States of rest: of a bath, and of a vessel that gives what the gel takes."""
    vessel = quarter(cells=3, baths=[Bath("top|right", c=0.1, vessel=Vessel(50.0))], initial=(0.15, 0.0), ranks=True)
    return {"bath": quarter(cells=4, ranks=True).equilibrate().values, "vessel": vessel.equilibrate().values}


def growth() -> dict[str, Any]:
    """The factor of a perturbation in one step."""
    return {"factor": np.array(strip(Frozen(), cells=(1, 8), ranks=True).growth_factor(5.0).factor)}


def lagged() -> dict[str, Any]:
    """Conditions that take the charge of the last step."""
    steps = Fixed(2.0, scheme=BACKWARD_EULER)
    rules = (None, InnerLayer())
    return {str(rule): strip(Lagged(rule), FALLING, (1, 12), ranks=True).run(10.0, steps).end.values for rule in rules}


def kinked() -> dict[str, Any]:
    """Fibres that go taut, whose energy stays apart from other terms."""
    solid = FibreReinforced(NeoHookean(), [Fibres((1.0, 0.0, 0.0), 0.5)])
    gel = quarter(None, FALLING, 3, material=Material(**{**vars(TABLE_2), "solid": solid}), ranks=True)
    return {"end": gel.run(20.0, Adaptive(1e-2)).end.values}


def parts() -> dict[str, Any]:
    """A second part of a test, and what its state says."""
    scene = strip(None, FALLING, (1, 8), model=Concentration(), ranks=True)
    second = scene.after(scene.run(10.0, Fixed(5.0)), baths=[Bath("top", c=Ramp((0, 0.125), (20, 0.15)))])
    end = second.run(20.0, Fixed(5.0)).end
    return {"end": end.values, "J": np.array(second.state(end).at((0.01, 0.2), "J"))}


def failure() -> dict[str, Any]:
    """A charged body that is let go at once: every rank says the same."""
    try:
        quarter(mesh=rectangle(1.0, 0.6, 2, 2), baths=[Bath("right", c=0.15)], ranks=True).run(10.0)
    except StepError as error:
        return {"time": np.array(error.time), "end": error.end.values, "said": str(error)}
    return {}


def rows() -> dict[str, Any]:
    """A matrix divided by rows, put together again."""
    problem = cube(2, ranks=True).problem
    divided = Rows(problem.linearise(), problem.free, problem.team)
    assert divided.take()
    mine, size = divided.dofs[divided.own], problem.space.ndof
    there = np.zeros((size, size))
    there[np.repeat(mine, np.diff(divided.starts)), divided.dofs[divided.columns]] = divided.values
    problem.team.sum_values(there)
    owners = np.zeros(size)
    owners[mine] += 1
    problem.team.sum_values(owners)
    return {"matrix": there, "owners": owners}


TASKS: dict[str, Callable[[], dict[str, Any]]] = {
    task.__name__: task for task in (observers, rest, growth, lagged, kinked, parts, failure, rows)
}


def scene(name: str) -> dict[str, Any]:
    """Fields at the end, accepted steps with their iterations, and what the ledger says, of the scene `name`."""
    make, steps, until = SCENES[name]
    ledger = Ledger()
    result = make(ranks=True).run(until, steps, [ledger])
    return {
        "values": result.end.values,
        "times": np.array([step.time for step in result.steps]),
        "iterations": sum(step.iterations for step in result.steps),
        "fluid": ledger.fluid,
    }


def outcome(name: str) -> dict[str, Any]:
    """What the scene or task `name` gives."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InstabilityWarning)  # a body under dead loads may be unstable
        warnings.simplefilter("ignore", ExtrapolationWarning)
        return scene(name) if name in SCENES else TASKS[name]()
