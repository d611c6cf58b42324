"""Each reason why a run stops: a small case that stops with it, and the remedies of its message, run on that case."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from ngsolve import Parameter, sqrt

from ngswell import (
    BACKWARD_EULER,
    TABLE_1,
    TABLE_2,
    Adaptive,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    DampedNewton,
    Fixed,
    InstabilityError,
    Lagged,
    Multiplier,
    Nitsche,
    Penalty,
    PlaneStrain,
    Potential,
    Ramp,
    Roller,
    Scene,
    Spatial,
    Stability,
    StepError,
    Symmetry,
    Traction,
    Uncharged,
    box,
    column,
    rectangle,
)
from ngswell.errors import REMEDIES, Reason
from ngswell.physics import donnan
from ngswell.schedules import Schedule, Signal
from ngswell.solve.direct import LinearSolver
from tests.scenes import WITHOUT_IONS, confined_column, strip


def body(**changes):
    """A quarter of a square of Table 1, 3 × 2 cells, wet above and beside."""
    fields = {
        "mesh": rectangle(1.0, 1.0, 3, 2),
        "kinematics": PlaneStrain(),
        "material": TABLE_1,
        "supports": [Symmetry("left"), Symmetry("bottom")],
        "baths": [Bath("top|right", c=0.15)],
    }
    return Scene(**fields | changes)


def gel(c, **changes):
    """A confined column of 10 cells without load."""
    return confined_column(changes.pop("treatment", None), c, 10, loads=[], **changes)


def pressed(load, **changes):
    return body(
        **{"model": Uncharged(), "material": WITHOUT_IONS, "baths": [Bath("top|right")], "loads": down(load)} | changes
    )


def down(load):
    return [Traction("top", (0.0, -load))]


COVERED: set[Reason] = set()
"""Reasons that a case below stops with."""


def stops(reason, run):
    """The error with which `run` stops, for this reason and with its remedies."""
    with pytest.raises(StepError, match=r"Remedies: ") as caught:
        run()
    assert caught.value.reason is reason
    assert str(caught.value).endswith(REMEDIES[reason])
    return caught.value


def case(*reasons):
    COVERED.update(reasons)
    return lambda test: test


def test_every_reason_has_a_case():
    assert set(Reason) == COVERED


# -- charge --------------------------------------------------------------------------------------------------------------


BONDED = {"material": TABLE_2, "supports": [Roller("bottom", "xy"), Symmetry("left")]}


@case(Reason.OUT_OF_BALANCE)
def test_a_first_charged_scene_is_told_of_its_start():
    error = stops(Reason.OUT_OF_BALANCE, lambda: body(**BONDED).run(100.0))
    assert "imperfection" not in str(error)
    assert "more salt" not in str(error)
    scene = body(**BONDED)
    scene.run(100.0, resume=scene.equilibrate(unstable="off"), unstable="off")
    body(charge=Ramp((0, 0), (1e5, 1)), **BONDED).run(1.1e5, Adaptive(1e-2), unstable="off")
    pressure = donnan.pressure(0.15, TABLE_2.number("cfc0"), TABLE_2.RT)
    carried = [Traction("top", (0.0, -pressure)), Traction("right", (-pressure, 0.0))]
    body(loads=carried, **BONDED).run(100.0, unstable="off")


@pytest.mark.parametrize("salt", [0.15, 0.02])
def test_a_charged_disc_is_told_of_its_start_also_when_it_has_begun_to_swell(salt):
    # In potentials the first step fails, in concentrations one after some hundredths of a second, as ions run out.
    model = Potential() if salt == 0.15 else Concentration()
    pieces = {
        "mesh": rectangle(1.0, 0.5, 4, 3), "kinematics": Axisymmetric(), "material": TABLE_2, "model": model,
        "supports": [Roller("bottom", "z"), Roller("left", "r")], "baths": [Bath("top|right", c=salt)],
    }  # fmt: skip
    error = stops(Reason.OUT_OF_BALANCE, lambda: body(**pieces).run(100.0, Adaptive(1e-2), unstable="off"))
    assert (error.time > 0) == (salt == 0.02)
    assert "resume=scene.equilibrate()" in str(error)
    assert "charge=Ramp((0, 0), (T, 1))" in str(error)
    scene = body(**pieces)
    scene.run(100.0, resume=scene.equilibrate(unstable="off"), unstable="off")
    body(charge=Ramp((0, 0), (4e5, 1)), **pieces).run(4e5, Adaptive(1e-1), unstable="off")


def test_a_sudden_release_takes_finer_cells():
    loose = [Roller("bottom", "xy")]
    stops(Reason.OUT_OF_BALANCE, lambda: body(supports=loose).run(100.0))
    fine = rectangle(1.0, 1.0, 6, 6, grade={"top": 30, "right": 30})
    body(mesh=fine, supports=loose).run(100.0, Adaptive(1e-2), unstable="off")


def disc(model, **changes):
    """Of 14 mm, in little salt."""
    return body(
        **{"mesh": rectangle(7.0, 2.0, 4, 2), "kinematics": Axisymmetric(), "material": TABLE_2, "model": model} | changes
    )


def block(model, **changes):
    """An eighth of a cuboid."""
    supports = [Symmetry("left"), Symmetry("front"), Symmetry("bottom")]
    baths = [Bath("top|right|back", c=0.15)]
    fields = {"mesh": box(1.0, 1.0, 0.5, 2, 1, 1), "kinematics": Spatial(), "supports": supports, "baths": baths}
    return body(**fields | {"model": model} | changes)


@case(Reason.CHARGE_OUTRUNS_SALT)
@pytest.mark.parametrize("model", [Potential(), Concentration()], ids=str)
@pytest.mark.parametrize(("make", "too_fast"), [(body, 10.0), (disc, 1000.0), (block, 10.0)])
def test_a_charge_that_rises_too_fast_is_told_of_its_ramp(make, too_fast, model):
    def raised(within):
        scene = make(model=model, charge=Ramp((0, 0), (within, 1)))
        return scene.run(1.1 * within, Adaptive(1e-2), unstable="off")

    error = stops(Reason.CHARGE_OUTRUNS_SALT, lambda: raised(too_fast))
    assert "load" not in str(error)
    enough = float(re.search(r"that takes some (\d+) s here", str(error))[1])
    assert too_fast < enough
    raised(enough)
    scene = make(model=model)
    scene.run(100.0, resume=scene.equilibrate(unstable="off"), unstable="off")


@pytest.mark.parametrize("model", [Potential(), Concentration()], ids=str)
def test_a_sealed_body_has_no_salt_for_its_charge(model):
    fields = {"model": model, "charge": Ramp((0, 0), (1000, 1))}
    error = stops(Reason.CHARGE_OUTRUNS_SALT, lambda: body(baths=[], initial=(0.15, 0.0), **fields).run(2000.0))
    assert "no bath gives any" in str(error)
    body(**fields).run(2000.0)


# -- salt ----------------------------------------------------------------------------------------------------------------


def diluted(c, within, treatment, steps):
    """A block at rest in 1 mol/l, whose bath then goes to `c`: anions vanish in a layer of a fraction of a cell."""
    bath = Bath("top|right", c=Ramp((0, 1.0), (within, c)), treatment=treatment)
    scene = body(mesh=rectangle(1.0, 1.0, 3, 3), material=TABLE_2, baths=[bath], model=Concentration())
    return scene.run(within + 90.0, steps, resume=scene.equilibrate())


@case(Reason.IONS_RUN_OUT)
def test_a_bath_of_nearly_pure_water():
    """Salt or anions run out: which of them first, and in which step, is a matter of round-off."""
    with pytest.raises(StepError, match=r"Remedies: ") as caught:
        diluted(1e-9, 10.0, Nitsche(20.0), Fixed(1.0))
    assert caught.value.reason in (Reason.IONS_RUN_OUT, Reason.NOT_A_SOLUTION)
    diluted(1e-9, 10.0, Penalty(relative=1e4), Fixed(1.0))
    diluted(1e-9, 10.0, Multiplier(), Fixed(1.0))
    diluted(1e-2, 10.0, Nitsche(20.0), Fixed(1.0))
    diluted(1e-9, 1e4, Nitsche(20.0), Fixed(100.0))


@dataclass(frozen=True)
class Wary(Concentration):
    """Asks for a tenth of mol/l of anions in a solution, so that none passes the dilution below."""

    def solution_bounds(self, state):
        return {"anions less 0.1 mol/l": state.c - state.cfc - 0.1}


@case(Reason.NOT_A_SOLUTION)
def test_too_few_anions_in_a_solution():
    salt = Ramp((0, 0.5), (10, 0.01))
    stops(Reason.NOT_A_SOLUTION, lambda: gel(salt, model=Wary()).run(100.0, Fixed(5.0)))
    gel(salt, model=Concentration()).run(100.0, Fixed(5.0))
    gel(Ramp((0, 0.5), (1000, 0.4)), model=Wary()).run(100.0, Fixed(5.0))


# -- loads ---------------------------------------------------------------------------------------------------------------


@case(Reason.LOADED_AT_ONCE)
def test_a_sudden_load_is_told_of_the_load():
    error = stops(Reason.LOADED_AT_ONCE, lambda: pressed(5.0).run(100.0))
    assert "charge that is raised" not in str(error)
    pressed(0.1).run(100.0)
    along = {"mesh": column(1.0, 3), "kinematics": Confined(), "supports": [Roller("bottom", "x")], "baths": [Bath("top")]}
    pressed(5.0, **along, loads=[Traction("top", (-5.0,))]).run(100.0)


@case(Reason.NOT_ADMISSIBLE)
def test_more_than_a_body_bears():
    """Confined, without charge and λ: µ (1 − nS0²)/nS0 and no more, which the message says."""
    soft = replace(TABLE_1, cfc0=0.0, lam=0.0)
    most = 0.24 * (1 - 0.25**2) / 0.25
    stops(Reason.NOT_ADMISSIBLE, lambda: strip(material=soft, loads=down(1.01 * most)).equilibrate())
    strip(material=soft, loads=down(0.99 * most)).equilibrate(unstable="off")


@case(Reason.TURNS_OVER)
def test_cells_that_fold_at_a_bonded_edge():
    def fine_at_the_edge(grade):
        mesh = rectangle(1.0, 1.0, 8, 8, grade={"bottom": grade, "right": grade})
        return body(mesh=mesh, supports=[Roller("bottom", "xy"), Symmetry("left")])

    stops(Reason.TURNS_OVER, fine_at_the_edge(400.0).equilibrate)
    fine_at_the_edge(25.0).equilibrate()


@case(Reason.UNSTABLE)
def test_an_unstable_body_is_told_of_its_load_or_its_bath():
    stops(Reason.UNSTABLE, lambda: pressed(1.0).run(100.0, unstable="off"))
    pressed(0.1).run(100.0)
    layer = {
        "mesh": rectangle(0.3, 0.2, 6, 4),
        "material": TABLE_2,
        "supports": [Roller("bottom", "xy"), Roller("left|right", "x")],
    }

    def film(c, **changes):
        return body(**{**layer, "charge": Ramp((0, 0), (1e4, 1)), "baths": [Bath("top", c=c)], **changes})

    def watched(scene, *observers):
        return lambda: scene.run(3e4, Adaptive(1e-2), observers, unstable="error")

    for observers in ((), (Stability(),)):
        assert isinstance(stops(Reason.UNSTABLE, watched(film(0.05), *observers)), InstabilityError)
    watched(film(0.5), Stability())()
    thin = {"mesh": column(0.2, 6), "kinematics": Confined(), "supports": [Roller("bottom", "x")]}
    watched(film(0.05, **thin), Stability())()


# -- numbers -------------------------------------------------------------------------------------------------------------


@case(Reason.NOT_ADMISSIBLE_AT_START)
def test_a_state_made_by_hand():
    scene = gel(Ramp((0, 0.15), (10, 0.125)), model=Potential(), charge=Ramp((0, 0), (1000, 1)))
    end = scene.run(100.0).end
    squeezed = end.values.copy()
    squeezed[scene.problem.ranges["u"]] -= np.linspace(0, 0.9, scene.problem.ranges["u"].stop)
    squeezed[~np.array(list(scene.problem.free))] = end.values[~np.array(list(scene.problem.free))]
    stops(Reason.NOT_ADMISSIBLE_AT_START, lambda: scene.run(200.0, resume=replace(end, values=squeezed)))
    scene.run(200.0, resume=end)


SLOW = {"charge": Ramp((0, 0), (1000, 1))}


@case(Reason.STALLED, Reason.TOO_MANY_ITERATIONS)
@pytest.mark.parametrize(
    ("reason", "scene", "newton"),
    [
        (Reason.STALLED, body(**SLOW), DampedNewton(tolerance=1e-16)),  # below round-off
        (Reason.TOO_MANY_ITERATIONS, body(**SLOW), DampedNewton(tolerance=1e-16, most_iterations=1)),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_a_newton_that_asks_too_much(reason, scene, newton):
    stops(reason, lambda: scene.run(100.0, newton=newton))
    scene.run(100.0)


class Refusing(LinearSolver):
    """Fails on right-hand sides that are `refused`: a solver of one's own that breaks down."""

    def __init__(self, problem, refused):
        super().__init__(problem.free)
        self.refused = lambda right: refused(right[problem.ranges["u"]])

    def solve(self, right, *vectors):
        return not self.refused(right.FV().NumPy()) and super().solve(right, *vectors)


@case(Reason.SINGULAR)
def test_a_solver_that_breaks_down():
    scene = body(**SLOW)
    stops(Reason.SINGULAR, lambda: scene.run(100.0, solver=lambda problem: Refusing(problem, np.any)))
    scene.run(100.0)


@case(Reason.ESTIMATE_NOT_FINITE)
def test_an_estimate_that_fails_does_not_stop_a_run():
    """The defect of contents, with which errors are told, has no forces. Backward Euler's steps need no such solve."""
    result = body(**SLOW).run(100.0, solver=lambda problem: Refusing(problem, lambda forces: not forces.any()))
    reasons = {rejection.reason for step in result.steps for rejection in step.rejected}
    assert Reason.ESTIMATE_NOT_FINITE in reasons
    assert REMEDIES[Reason.ESTIMATE_NOT_FINITE] == REMEDIES[Reason.SINGULAR]


def test_a_law_that_ends():
    ending = replace(TABLE_1, permeability=lambda K, J, nS0: K * sqrt((1.1 - J) / 0.1))
    stops(Reason.SINGULAR, lambda: body(material=ending, **SLOW).run(2000.0))
    smooth = replace(TABLE_1, permeability=lambda K, J, nS0: K * sqrt((11 - J) / 10))
    body(material=smooth, **SLOW).run(2000.0)


@case(Reason.UNDETERMINED)
def test_a_body_that_nothing_holds(monkeypatch):
    # Without the checks of the scene: what else may leave a system undetermined is found in its matrix.
    monkeypatch.setattr("ngswell.setup.setup.check_determined", lambda *arguments: None)
    # A force along the motion, or round-off decides whether forces balance.
    pushed = {**SLOW, "loads": down(1e-3)}
    error = stops(Reason.UNDETERMINED, lambda: body(supports=[Symmetry("left")], **pushed).run(100.0, Fixed(10.0)))
    assert "the body can translate in y" in str(error)
    body(**pushed).run(100.0, Fixed(10.0))


@dataclass(frozen=True)
class Jump(Schedule):
    """Salt [mol/l] that jumps at 5 s; a `kink` there, if it names it."""

    kinks: tuple[float, ...] = ()
    bends = ()
    values = (0.15, 0.05)
    uniform = True

    def at(self, time):
        return self.values[time > 5.0]

    def signal(self):
        value = Parameter(0.15)
        return Signal(value, lambda time: value.Set(self.at(time)))

    def check_on(self, where):
        pass


@case(Reason.ERROR_ABOVE_TOLERANCE)
def test_a_history_that_jumps_unsaid():
    def diluted(salt, steps):
        return confined_column(None, salt, 10, model=Concentration()).run(20.0, steps)

    # Below 2e-8 the step after a jump that is said is as short as the clock tells, too.
    stops(Reason.ERROR_ABOVE_TOLERANCE, lambda: diluted(Jump(), Adaptive(2e-8)))
    diluted(Jump((5.0,)), Adaptive(2e-8))
    diluted(Jump(), Adaptive(1e-5))
    diluted(Jump(), Fixed(1.0))


@case(Reason.OSCILLATES)
def test_a_lagged_bath_is_told_of_its_treatment():
    def diluted(treatment):
        return strip(treatment, Ramp((0, 0.15), (10, 0.125))).run(1e4, Adaptive(1e-2, scheme=BACKWARD_EULER))

    stops(Reason.OSCILLATES, lambda: diluted(Lagged()))
    diluted(Penalty(1.0))
