"""What docs/extend.md shows: pieces of one's own, each in a file below 25 lines, against its closed form."""

from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

from examples.extend_bath import Film
from examples.extend_function import history, note_the_middle
from examples.extend_load import Springs
from examples.extend_observer import LargestStress
from examples.extend_solid import SquareNeoHookean
from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Bath,
    Checkpoint,
    Concentration,
    Confined,
    Fixed,
    InputError,
    Penalty,
    Potential,
    Ramp,
    Roller,
    Scene,
    Stability,
    column,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import CLOSED, FREE

EXAMPLES = Path(__file__).parents[2] / "examples"

DIRECTIONS = {"confined": 1, "plane strain": 2, "axisymmetric": 3, "3-d": 3}
"""In which the bodies stretch."""
CHARGED = Ramp((0, 0.0), (4000, 1.0))  # no faster than salt diffuses in


def body(motion, material=TABLE_2, salt=0.3, loads=lambda boundary: [], **changes):
    mesh, kinematics, supports, wet = FREE[motion]
    return Scene(
        **{
            "mesh": mesh(), "kinematics": kinematics, "material": material, "supports": supports,
            "baths": [Bath(wet, c=salt)], "loads": loads(wet), **changes,
        }
    )  # fmt: skip


def middle(scene):
    return (0.5,) * scene.mesh.dim


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("extend_*.py")), ids=lambda file: file.stem)
def test_each_is_short(file):
    assert len(file.read_text().splitlines()) < 25


# -- load --------------------------------------------------------------------------------------------------------------

STIFFNESS = 0.1  # N/mm³
HELD = {"confined": "", "plane strain": "right:x", "axisymmetric": "right:r", "3-d": "right:x back:y"}
"""What else holds the motions' bodies, so that the top alone moves."""


def sprung(motion, stiffness, **changes):
    others = [Roller(*pair.split(":")) for pair in HELD[motion].split()]
    supports = [*FREE[motion][2], *others]
    baths, springs = [Bath("top", c=0.3)], [Springs("top", stiffness)]
    return body(motion, supports=supports, baths=baths, loads=lambda wet: springs, **changes)


@pytest.mark.parametrize("motion", FREE)
def test_springs_come_to_the_closed_form(motion):
    scene = sprung(motion, Ramp((0, STIFFNESS)))
    found = scene.state(scene.equilibrate()).at(middle(scene), "J")  # the top has moved by J − 1 times its height, 1
    exact = homogeneous_equilibrium(TABLE_2, 0.3, "confined", load=STIFFNESS * (found - 1)).J
    assert found == pytest.approx(exact, rel=1e-10)  # homogeneous: exact in the space, Newton's method to round-off
    assert abs(homogeneous_equilibrium(TABLE_2, 0.3, "confined").J - exact) > 0.1  # control: without the load


def test_a_load_follows_its_history():
    stiffness = Ramp((0, 0.0), (100, STIFFNESS))
    scene = sprung("plane strain", stiffness, charge=CHARGED)
    assert 100.0 in [step.time for step in scene.run(200.0, Adaptive(1e-2)).steps]  # steps land where the history bends
    scene = sprung("plane strain", stiffness)
    rest = scene.state(scene.equilibrate(50.0)).at((0.5, 0.5), "J")
    load = STIFFNESS / 2 * (rest - 1)
    assert rest == pytest.approx(homogeneous_equilibrium(TABLE_2, 0.3, "confined", load=load).J, rel=1e-10)
    assert "springs on top" in scene.describe()


def test_a_load_says_its_refusals():
    with pytest.raises(InputError, match="Springs: the mesh has no boundary 'lid'"):
        body("plane strain", loads=lambda wet: [Springs("lid", Ramp((0, 1.0)))])


# -- solid -------------------------------------------------------------------------------------------------------------

square_gel = replace(TABLE_2, solid=SquareNeoHookean())


def square_balance(free, salt=0.3, m=TABLE_2):
    """J of µ (J^(2/d) − 1) + λ/2 (J² − 1) = J p_D, by bisection: written out, not from the energy."""

    def excess(J):
        cfc = (1 - m.nS0) * m.cfc0 / (J - m.nS0)
        p = 2 * m.RT * (sqrt(salt**2 + cfc**2 / 4) - salt)
        return m.mu * (J ** (2 / free) - 1) + m.lam / 2 * (J**2 - 1) - J * p

    low, high = 1.0, 50.0
    while low < (middle := (low + high) / 2) < high:
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)
    return high


@pytest.mark.parametrize("motion", FREE)
def test_a_solid_of_ones_own_comes_to_its_balance(motion):
    scene, free = body(motion, square_gel), DIRECTIONS[motion]
    state = scene.state(scene.equilibrate())
    J = square_balance(free)
    assert state.at(middle(scene), "J") == pytest.approx(J, rel=1e-8)
    assert pytest.approx(1, rel=1e-12) == homogeneous_equilibrium(square_gel, 0.3, CLOSED[motion]).J / J
    assert abs(homogeneous_equilibrium(TABLE_2, 0.3, CLOSED[motion]).J - J) > 1e-3 * J  # control: the paper's law

    # The surface is free: no stress along the free directions. Across, the motion holds: −p + (µ (1 − 1) + λ/2 (J² − 1))/J.
    stress = np.array(state.at(middle(scene), "stress")).reshape(3, 3)
    held = TABLE_2.lam / 2 * (J**2 - 1) / J - state.at(middle(scene), "p")
    expected = np.diag([0.0 if axis < free else held for axis in range(3)])
    assert stress == pytest.approx(expected, abs=1e-8)  # the balance is met to 1e-8 of stresses of 0.1
    assert "solid: SquareNeoHookean()" in scene.describe()


def test_stability_and_checkpoints_follow_the_solid(tmp_path):
    scene = body("plane strain", square_gel, charge=CHARGED)
    stability = Stability(when=[1600.0])
    through = scene.run(2000.0, Fixed(200.0), [stability])
    assert stability.rates.tolist() == [0.0]
    scene.run(1000.0, Fixed(200.0), checkpoint=Checkpoint(tmp_path / "square"))
    resumed = scene.run(2000.0, Fixed(200.0), checkpoint=Checkpoint(tmp_path / "square"))
    assert len(resumed.steps) == len(through.steps)
    assert resumed.end.values == pytest.approx(through.end.values, rel=1e-9)
    with pytest.raises(InputError, match="of another scene: material differ"):
        body("plane strain", charge=CHARGED).run(3000.0, Fixed(200.0), checkpoint=Checkpoint(tmp_path / "square"))


def test_a_solid_with_stress_at_the_start_is_refused():
    class Stressed(SquareNeoHookean):
        def energy(self, deformation, material):
            return super().energy(deformation, material) + 0.1 * deformation.J

    with pytest.raises(InputError, match=r"has a stress of 0\.1 N/mm² at F = I"):
        body("plane strain", replace(TABLE_2, solid=Stressed()))
    with pytest.raises(InputError, match="solid has to be a law with energy"):
        replace(TABLE_2, solid=abs)


# -- bath --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [Concentration(), Potential()])
def test_a_film_is_a_penalty_to_the_last_digit(model):
    def end(treatment):
        scene = Scene(
            mesh=column(0.5, 10), kinematics=Confined(), material=TABLE_1, model=model, supports=[Roller("bottom", "x")],
            baths=[Bath("top", c=Ramp((0, 0.15), (10, 0.125)), treatment=treatment)],
        )  # fmt: skip
        return scene.run(50.0, Fixed(5.0)).end.values

    assert (end(Film(0.7, 0.7)) == end(Penalty(0.7))).all()
    assert not (end(Film(0.7, 0.6)) == end(Penalty(0.7))).all()


# -- observers ---------------------------------------------------------------------------------------------------------


def test_the_largest_stress_of_a_held_gel():
    """A gel held sideways in plane strain: across the plane it presses with −p + τ_zz/J, in the plane it is free."""
    scene, largest = body("plane strain"), LargestStress()
    scene.equilibrate(observers=[largest])
    assert largest.values == pytest.approx([0.0], abs=1e-8)  # both others are zero; the held one presses
    state = scene.state(scene.equilibrate())
    J, p = state.at((0.5, 0.5), "J"), state.at((0.5, 0.5), "p")
    m = TABLE_2
    across = m.lam * (1 - m.nS0) ** 2 * (1 / (1 - m.nS0) - 1 / (J - m.nS0)) - p
    assert np.array(state.at((0.5, 0.5), "stress")).reshape(3, 3)[2, 2] == pytest.approx(across, rel=1e-10)
    assert across < -0.03

    run = LargestStress(when=[0.0, 400.0])
    body("plane strain", charge=CHARGED).run(800.0, Fixed(200.0), [run])
    assert run.time.tolist() == [0.0, 400.0]
    assert run.values[0] == pytest.approx(0.0, abs=1e-15)  # the reference state, without charge
    assert run.values[1] > 1e-4  # the skin swells first and pulls at the core


def test_a_function_observes():
    scene = Scene(
        mesh=column(0.5, 4), kinematics=Confined(), material=TABLE_1, supports=[Roller("bottom", "x")],
        baths=[Bath("top", c=Ramp((0, 0.15), (10, 0.125)))],
    )  # fmt: skip
    history.clear()
    result = scene.run(20.0, Fixed(5.0), [note_the_middle])
    assert [time for time, _ in history] == [0.0, 5.0, 10.0, 15.0, 20.0]
    assert history[-1][1] == result.state.at((0.25,), "p")
    with pytest.raises(InputError, match="got the class LargestStress"):
        scene.run(20.0, Fixed(5.0), [LargestStress])
