"""States past the limit of stability are told by default, at the limits that closed forms give; stable ones are not."""

import warnings
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Axisymmetric,
    Bath,
    Checkpoint,
    Concentration,
    Confined,
    Fixed,
    InputError,
    InstabilityError,
    InstabilityWarning,
    Multiplier,
    Penalty,
    PlaneStrain,
    Potential,
    Probe,
    Ramp,
    Roller,
    Scene,
    Stability,
    Symmetry,
    Traction,
    TwoLevelSolver,
    column,
    read_checkpoint,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.run import guard
from ngswell.solve.direct import LinearSolver


def said(act):
    """The warnings of instability that something gives."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        act()
    assert {warning.category for warning in caught} <= {InstabilityWarning}
    return [str(warning.message) for warning in caught]


def clamped(thickness, bath, cells=(16, 2)):
    """A strip of Table 1, 1 mm long, clamped at both ends between two baths."""
    return Scene(
        mesh=rectangle(1.0, thickness, *cells),
        kinematics=PlaneStrain(),
        material=TABLE_1,
        supports=[Roller("left|right", "xy")],
        baths=[Bath("top|bottom", c=bath)],
    )


def film(bath, model=None):
    """A film of Table 2 on a clamped base."""
    return Scene(
        mesh=rectangle(0.4, 0.2, 16, 6, grade={"top": 3.0}),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        model=model or Potential(),
        supports=[Symmetry("left|right"), Roller("bottom", "xy")],
        baths=[Bath("top", c=bath)],
    )


def cushion(bath):
    """4 × 4 cells of Table 2 between smooth walls, and their state of rest, homogeneous whether stable or not."""
    scene = Scene(
        mesh=rectangle(0.2, 0.2, 4, 4),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        supports=[Roller("left|right", "x"), Roller("bottom", "y")],
        baths=[Bath("top", c=bath)],
    )
    return scene, scene.equilibrate(unstable="off")


def bath_that_stretches(by):
    """Bath [mol/l] in which a free strip of Table 1 is longer by this share, by bisection of the closed form."""
    low, high = 0.05, 10.0
    for _ in range(50):
        middle = (low * high) ** 0.5
        longer = by < homogeneous_equilibrium(TABLE_1, middle, "plane strain").J ** 0.5 - 1
        low, high = (middle, high) if longer else (low, middle)
    return low


# -- limits ------------------------------------------------------------------------------------------------------------


def test_a_clamped_strip_buckles_where_euler_has_it():
    # Clamped at both ends, held back by the strain ε: ε = π² h²/(3 L²), whatever the stiffness; shear and the ends' clamped
    # thickness take some h/L = 5 % of it. Between 1.00 and 1.05 times that on these cells and on twice as many.
    euler = pi**2 * 0.05**2 / 3
    assert said(clamped(0.05, bath_that_stretches(0.95 * euler)).equilibrate) == []
    (message,) = said(clamped(0.05, bath_that_stretches(1.05 * euler)).equilibrate)
    assert "(0.5, 0.025) mm" in message


@pytest.mark.parametrize("model", [Potential(), Concentration()], ids=lambda m: type(m).__name__)
def test_a_film_wrinkles_where_the_half_space_does(model):
    # J = 2.487 and 2.507; the half-space wrinkles at 2.496 (docs/convergence.md).
    J = [homogeneous_equilibrium(TABLE_2, bath, "confined").J for bath in (0.145, 0.14)]
    assert J[0] < 2.496 < J[1]
    assert said(film(0.145, model).equilibrate) == []
    (message,) = said(film(0.14, model).equilibrate)
    assert "t = 0 s is unstable: perturbations grow by a factor e in" in message


def test_what_stays_straight_or_flat_far_beyond_is_told():
    # Ten and more modes are unstable, most of them at once. The rest state is the straight one: only the word tells.
    thick = clamped(0.1, 0.15, (20, 4))
    assert "in wrinkles of about 1.2 mm" in said(thick.equilibrate)[0]
    assert "s is unstable: perturbations grow at once" in said(lambda: thick.run(1000.0))[0]  # at the first look
    assert "in wrinkles of about" in said(film(0.05).equilibrate)[0]
    # Inverse iteration runs into a slower mode here, the bounds tell the rate.
    assert "in 2.05 s" in said(film(0.12).equilibrate)[0]


# -- no false alarms ---------------------------------------------------------------------------------------------------


def stable_scene(rng, kind):
    """A body far from any limit (J below 1.7), its bath up or down by a ramp of 1 to 200 s, some of it loaded."""
    conc = bool(rng.random() < 0.5)
    treatment = [Penalty(10.0), Multiplier(), None][rng.integers(3)] if conc else None
    start = rng.uniform(0.5, 2.0)
    ramp = rng.choice([1.0, 30.0, 200.0])
    parts = {
        "material": [TABLE_1, TABLE_2][rng.integers(2)],
        "model": Concentration() if conc else Potential(),
    }
    bath = {"c": Ramp((0, start), (ramp, start * rng.uniform(0.3, 1.2))), "treatment": treatment}
    load = -rng.choice([0.0, 0.005, 0.02])
    if kind == "column":
        own = {
            "mesh": column(0.5, 12), "kinematics": Confined(), "supports": [Roller("bottom", "x")],
            "baths": [Bath("top", **bath)], "loads": [Traction("top", (load,))],
        }  # fmt: skip
    elif kind == "guided":
        own = {
            "mesh": rectangle(0.1, 0.5, 1, 8), "kinematics": PlaneStrain(),
            "supports": [Roller("bottom", "y"), Roller("left|right", "x")],
            "baths": [Bath("top", **bath)], "loads": [Traction("top", (0.0, load))],
        }  # fmt: skip
    else:
        own = {
            "mesh": rectangle(1.0, 0.7, 4, 3), "kinematics": PlaneStrain() if kind == "block" else Axisymmetric(),
            "supports": [Symmetry("left"), Symmetry("bottom")], "baths": [Bath("top|right", **bath)],
        }  # fmt: skip
    steps = [Adaptive(1e-2), Adaptive(1e-3), Fixed(ramp / 5)][rng.integers(3)]
    return Scene(**parts, **own), ramp * rng.choice([0.5, 1.5, 5.0]), steps


def test_stable_states_and_transients_are_not_called_unstable():
    # States in the midst of ramps too, where the stiffness is not symmetric. Not one of the looks is even doubtful.
    rng = np.random.default_rng(3)
    for number in range(32):
        scene, until, steps = stable_scene(rng, ("column", "guided", "block", "disc")[number % 4])
        assert said(lambda: scene.run(until, steps, resume=scene.equilibrate())) == []  # noqa: B023


# -- what a run does ---------------------------------------------------------------------------------------------------


def test_the_answers():
    scene, rest = cushion(0.1)  # grows by 0.565 1/s
    with pytest.warns(InstabilityWarning, match=r"t = 2 s is unstable: .*in 1\.77 s") as caught:
        warned = scene.run(2.0, Fixed(0.5), resume=rest)
    assert caught[0].filename == __file__
    assert said(lambda: scene.run(2.0, Fixed(0.5), resume=rest, unstable="off")) == []
    assert warned.solves == scene.run(2.0, Fixed(0.5), resume=rest, unstable="off").solves
    with pytest.raises(InstabilityError) as stopped:
        scene.run(2.0, Fixed(0.5), resume=rest, unstable="error")
    assert stopped.value.rate == pytest.approx(0.565, rel=1e-3)
    assert np.array_equal(stopped.value.end.values, warned.end.values)
    with pytest.raises(InstabilityError, match="t = 0 s"):
        scene.equilibrate(unstable="error")
    for wrong in (scene.run, scene.equilibrate):
        with pytest.raises(InputError, match="unstable = 'quiet' is none of 'warn', 'error', 'off'"):
            wrong(1.0, unstable="quiet")


def test_growth_by_less_than_a_factor_e_does_not_count():
    scene, rest = cushion(0.1)  # a factor e takes 1.77 s
    assert said(lambda: scene.run(1.7, Fixed(0.5), resume=rest)) == []
    assert len(said(lambda: scene.run(1.9, Fixed(0.5), resume=rest))) == 1


def test_an_iterative_solver_tells_it_too():
    scene, rest = cushion(0.1)
    assert "in 1.77 s" in said(lambda: scene.run(2.0, Fixed(0.5), resume=rest, solver=TwoLevelSolver))[0]


class Failing(LinearSolver):
    """Finds no solution where steps are as long as the run."""

    def factorise(self, matrix):
        self.hopeless = self.problem.dt.Get() > 1.0
        return super().factorise(matrix)

    def invert(self, right, solution):
        return super().invert(right, solution) and not self.hopeless


def test_what_cannot_be_told_is_said():
    scene, rest = cushion(0.3)

    def failing(problem):
        solver = Failing(problem.free)
        solver.problem = problem
        return solver

    (message,) = said(lambda: scene.run(2.0, Fixed(0.5), resume=rest, solver=failing))
    assert "whether the state at t = 2 s is stable could not be told: the response to a perturbation" in message


def test_an_episode_that_steps_do_not_follow_is_told():
    # Unstable between the ramps only: at the end, nothing grows. Looks in between see what stages of 10 s lose.
    scene, rest = cushion(0.3)
    scene = replace(scene, baths=[Bath("top", c=Ramp((0, 0.3), (20, 0.1), (400, 0.1), (420, 0.3)))])
    (message,) = said(lambda: scene.run(500.0, Fixed(10.0), resume=rest))
    assert "Stages of 10 s do not follow that" in message
    with pytest.raises(InstabilityError) as stopped:
        scene.run(500.0, Fixed(10.0), resume=rest, unstable="error")
    assert 20 < stopped.value.time < 400


def test_where_stability_watches_and_where_a_bath_looks_back_a_run_does_not_look(monkeypatch):
    looks = []
    monkeypatch.setattr(guard, "Perturbations", lambda *given: looks.append(given))
    scene, rest = cushion(0.3)
    scene.run(1.0, Fixed(0.5), [Stability()], resume=rest)
    assert looks == []


# -- checkpoints -------------------------------------------------------------------------------------------------------


def test_an_unstable_state_is_kept_with_the_records_of_all_observers(tmp_path):
    # Stability stands before the probe, which sees the state nevertheless.
    scene, rest = cushion(0.145)
    scene = replace(scene, baths=[Bath("top", c=Ramp((0, 0.145), (5, 0.1)))])
    probe, file = Probe((0.05, 0.1), "J"), tmp_path / "run.checkpoint"
    with pytest.raises(InstabilityError) as stopped:
        scene.run(20.0, Fixed(1.0), [Stability(), probe], resume=rest, checkpoint=Checkpoint(file))
    kept = read_checkpoint(file)
    assert kept.snapshot.time == stopped.value.time == probe.time[-1] > 0
    assert np.array_equal(kept.snapshot.values, stopped.value.end.values)
    followed = scene.run(kept.snapshot.time + 1.0, Fixed(0.1), resume=kept.snapshot, unstable="off")
    assert followed.end.time == kept.snapshot.time + 1.0
