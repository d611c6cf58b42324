"""Rigid platens, moved or pushed."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import x

from examples.extend_load import Springs
from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Bath,
    Blend,
    Checkpoint,
    Concentration,
    Confined,
    Fixed,
    InnerLayer,
    InputError,
    Lagged,
    LocalDonnan,
    Material,
    Penalty,
    Pin,
    PlaneStrain,
    Platen,
    Potential,
    Pressure,
    Ramp,
    Reaction,
    Roller,
    Scene,
    Spherical,
    StepError,
    Symmetry,
    Traction,
    TwoLevelSolver,
    Uncharged,
    column,
    rectangle,
)
from ngswell.analysis.perturbations import Perturbations
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.problem.problem import Problem
from studies.limits.verification import quarter_disc
from tests.scenes import BETWEEN_WALLS

BALANCED = 1e-10
"""What Newton's method leaves of forces of 0.02 to 0.1."""


def block(*supports, **changes):
    """A block of Table 2 between its symmetry planes, 2 × 2 cells, with its bath at the right."""
    return Scene(
        **{
            "mesh": rectangle(1.0, 1.0, 2, 2), "kinematics": PlaneStrain(), "material": TABLE_2, "model": LocalDonnan(),
            "supports": [Symmetry("bottom"), Symmetry("left"), *supports], "baths": [Bath("right", c=0.3)], **changes,
        }
    )  # fmt: skip


def disc():
    return Scene(
        mesh=quarter_disc(0.5), kinematics=PlaneStrain(), material=TABLE_2, model=LocalDonnan(),
        supports=[Roller("axis", "x"), Roller("bottom", "y"), Platen("surface", force=-0.1)], baths=[Bath("axis", c=0.3)],
    )  # fmt: skip


DOWN = Ramp((0, 0.0), (10, -0.1))
WEAK = Ramp((0, 0.2))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Platen("top"), "give either displacement=.* or force="),
        (lambda: Platen("top", 0.1, 0.1), "give either displacement=.* or force="),
        (lambda: Platen("top", force="much"), "force has to be a number"),
        (lambda: Platen("top", force=0.1, glued="yes"), "glued has to be True or False"),
        (lambda: Platen("top", force=Blend(DOWN, Ramp((0, 0.0)), x)), "varies in space"),
        (lambda: block(Platen("lid", force=0.1)), "no boundary 'lid'"),
        (disc, "Platen on 'surface': it needs a plane side across an axis, .* curved or oblique"),
        (lambda: block(Platen("top|right", force=0.1)), "curved or oblique"),
        (
            lambda: block(
                mesh=column(1.0, 2), kinematics=Spherical(), supports=[Platen("top", force=0.1)], baths=[Bath("top", c=0.3)]
            ),
            "a cylinder or sphere has no plane side",
        ),
        (lambda: block(Platen("top|bottom", force=0.1)), "one plane side, this one is in several"),
        (lambda: block(Platen("top", force=-1e4)), "force of 10000 is more than 1000 N/mm² on its area of 1; units"),
        (lambda: block(Platen("top", displacement=-0.1)), "-0.1 mm at the start"),
        (lambda: block(Platen("bottom", displacement=DOWN)), "Symmetry on 'bottom' and Platen on 'bottom' hold"),
        (lambda: block(Platen("bottom", force=0.1)), "Symmetry on 'bottom' and Platen on 'bottom' hold .* differently"),
        (lambda: block(Platen("top", force=0.1), Roller("right", "y")), r"in y at the vertex \(1, 0\) mm|\(1, 1\) mm"),
        (lambda: block(Platen("top", force=0.1), Pin((0.0, 1.0), "y")), "which a Pin holds"),
        (lambda: block(Platen("top", force=0.1), Platen("top", force=0.1)), "differently"),
        (lambda: block(supports=[Symmetry("left"), Platen("top", force=0.1)]), "the body can translate in y"),
        (lambda: block(supports=[Platen("top", force=0.1, glued=True)]), "the body can translate in y"),
        (lambda: block(Platen("top", force=0.1), loads=[Traction("top", (0.0, 0.1))]), "a support holds it in y"),
        (lambda: block(Platen("top", force=0.1), loads=[Pressure("top", 0.1)]), "a support holds it along its normal"),
    ],
)  # fmt: skip
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_described():
    assert "\n  Platen on top: displaced as one by a force along y\n" in block(Platen("top", force=-0.1)).describe()
    assert "\n  Platen on top: displaced along y\n" in block(Platen("top", displacement=DOWN)).describe()
    assert "Platen" not in block().describe()


def test_a_platen_keeps_a_body_from_turning():
    block(supports=[Pin((0.0, 0.0), "xy"), Platen("top", force=-0.01)])
    with pytest.raises(InputError, match="the body can"):
        block(supports=[Pin((0.0, 0.0), "xy")])


# -- in every motion -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", BETWEEN_WALLS)
@pytest.mark.parametrize("porous", [True, False])
def test_the_height_under_a_force(motion, porous):
    """Between walls, a porous platen with the bath behind: J of the closed form, the bath's pressure on it or not."""
    mesh, kinematics, walls, up, area = BETWEEN_WALLS[motion]
    P = 0.01
    scene = Scene(
        mesh=mesh(), kinematics=kinematics, material=TABLE_2, model=LocalDonnan(),
        baths=[Bath("top", c=0.3, P=P, porous_plate=porous)],
        supports=[*walls, Roller("bottom", up), Platen("top", force=-0.05 * area)],
    )  # fmt: skip
    top, base = Reaction("top"), Reaction("bottom")
    state = scene.state(scene.equilibrate(observers=[top, base], unstable="off"))
    load = 0.05 - P if porous else 0.05  # on the skeleton: the bath's pressure is on the plate, or comes on top
    rest = homogeneous_equilibrium(TABLE_2, 0.3, "confined", load=load)
    point = (0.4, 0.4, 1.0)[-scene.mesh.dim :]
    lifted = np.atleast_1d(state.at(point, "displacement"))[-1]
    assert lifted == pytest.approx(rest.J - 1, rel=1e-8)
    assert top.values[-1, -1] == pytest.approx(0.05 * area, abs=BALANCED)
    assert base.values[-1, -1] == pytest.approx(-(0.05 if porous else 0.05 + P) * area, abs=BALANCED)


# -- on a column it is a dead load: the same equations, to round-off ------------------------------------------------------

PUSH = Ramp((0, 0.0), (5, -0.4))


def pushed(platen, **changes):
    held = [Roller("bottom", "x"), *([Platen("top", force=PUSH)] if platen else [])]
    return Scene(
        **{
            "mesh": column(0.5, 6), "kinematics": Confined(), "material": TABLE_1, "model": Potential(), "supports": held,
            "baths": [Bath("top", c=0.15)], "loads": [] if platen else [Traction("top", (PUSH,))],
            "charge": Ramp((0, 0.0), (50, 0.2)), **changes,
        }
    )  # fmt: skip


@pytest.mark.parametrize("steps", [Fixed(2.5), Adaptive(1e-4)])
@pytest.mark.parametrize("model", [Potential(3), Concentration(), LocalDonnan()])
def test_on_a_column_it_is_a_dead_load(steps, model):
    bath = Bath("top", c=0.15, treatment=Penalty(relative=1e3) if isinstance(model, Concentration) else None)
    one, other = (pushed(platen, model=model, baths=[bath]).run(50.0, steps, unstable="off") for platen in (True, False))
    # Factorisations of other matrices: solves agree to what their tolerance leaves, of stresses of 0.4 N/mm².
    assert np.abs(one.end.values - other.end.values).max() < 1e-7
    assert len(one.steps) == len(other.steps)


def test_perturbations_move_it():
    """The factor of growth of the lagged column, platen and dead load alike."""
    lagged = {
        "model": Concentration(),
        "baths": [Bath("top", c=0.15, treatment=Lagged(InnerLayer()))],
        "charge": Ramp((0, 1.0)),
    }
    one, other = (pushed(platen, **lagged).growth_factor(1e-3).factor for platen in (True, False))
    assert one == pytest.approx(other, rel=1e-6)
    assert abs(one + 0.1) > 1e-3
    held = replace(pushed(True, **lagged), supports=[Roller("bottom|top", "x")])
    assert abs(held.growth_factor(1e-3).factor - other) > 1e-2  # control: where the platen does not move


def fastest(scene):
    """Rate of the fastest perturbation of the initial state [1/s]; 0 where none grows."""
    problem = Problem(scene)
    problem.initialise()
    found = Perturbations(problem).fastest(1e-9)
    return 0.0 if found is None else found.rate


def repelled(cells, *supports, **changes):
    """A column of 1 mm with springs that push the further its end is from where it began, more than it bears by itself."""
    return Scene(
        **{
            "mesh": column(1.0, cells), "kinematics": Confined(), "supports": [Roller("bottom", "x"), *supports],
            "material": Material(mu=0.24, lam=0.16, nS0=0.25, K=1e-3), "model": Uncharged(), "baths": [Bath("bottom")],
            "loads": [Springs("top", Ramp((0, -0.7)))], **changes,
        }
    )  # fmt: skip


@pytest.mark.parametrize("glued", [False, True])
def test_a_platen_runs_away_like_a_free_end(glued):
    # s u = c_v u″ + s u(1), M u′(0) = 0.7 u(1), drained at 0: s = c_v k² with M k coth k = 0.7, M = 2µ + λ = 0.64 N/mm².
    free = [fastest(repelled(cells)) for cells in (4, 8)]
    assert (4 * free[1] - free[0]) / 3 == pytest.approx(1.834111547e-4, rel=1e-4)  # the error goes with h²
    walls = [Roller("bottom", "y"), Roller("left|right", "x")]
    slab = {"mesh": rectangle(1.0, 1.0, 3, 4), "kinematics": PlaneStrain()}
    carried = repelled(4, supports=[*walls, Platen("top", force=0.0, glued=glued)], **slab)
    assert fastest(carried) == pytest.approx(free[0], rel=1e-8)
    assert carried.growth_factor(1.0).factor == pytest.approx(1 / (1 - free[0]), rel=1e-8)
    assert fastest(repelled(4, supports=[*walls, Roller("top", "y")], **slab)) == 0.0  # control: held


def test_checkpoints_and_solvers(tmp_path):
    scene, kept = pushed(True), Checkpoint(tmp_path / "run")
    through = scene.run(20.0, Fixed(1.0), unstable="off").end.values
    scene.run(11.0, Fixed(1.0), checkpoint=kept, unstable="off")
    assert np.array_equal(scene.run(20.0, Fixed(1.0), checkpoint=kept, unstable="off").end.values, through)
    flat = block(Platen("top", force=-0.1), charge=WEAK)
    one, other = (flat.run(5.0, Fixed(1.0), unstable="off", **solver).end for solver in ({}, {"solver": TwoLevelSolver}))
    assert np.abs(one.values - other.values).max() < 1e-7  # Newton's tolerance
    with pytest.raises(InputError, match="leave solver= out for a column"):  # it ended in a MemoryError, or not at all
        scene.run(20.0, Fixed(1.0), solver=TwoLevelSolver)
    with pytest.raises(InputError, match="supports"):
        replace(scene, supports=[Roller("bottom", "x"), Platen("top", force=-0.4)]).run(30.0, checkpoint=kept)


# -- forces and displacements --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("glued", [False, True])
def test_a_force_gives_the_displacement_that_gives_it(glued):
    """A barrelling block: the plate stays plane, slides or sticks, and both controls are one equilibrium."""
    moved, force = block(Platen("top", displacement=DOWN, glued=glued), charge=WEAK), Reaction("top")
    first = moved.equilibrate(10.0, observers=[force], unstable="off")
    pushed_down = replace(moved, supports=[*moved.supports[:2], Platen("top", force=-force.values[-1, 1], glued=glued)])
    base = Reaction("bottom")
    second = pushed_down.equilibrate(10.0, observers=[base], unstable="off")
    assert np.abs(second.values - first.values).max() < 1e-9
    assert base.values[-1, 1] == pytest.approx(-force.values[-1, 1], abs=BALANCED)
    state = pushed_down.state(second)
    assert [state.at((s, 1.0), "displacement")[1] for s in (0.0, 0.3, 1.0)] == pytest.approx([-0.1] * 3, abs=1e-9)
    assert (abs(state.at((1.0, 1.0), "displacement")[0]) > 1e-2) is not glued


def test_creep_then_relaxation():
    """Pushed, then held where it is, then pushed again: three parts of one test, in balance at each end."""
    scene = block(Platen("top", force=Ramp((0, 0.0), (20, -0.2))), charge=Ramp((0, 0.0)))
    crept = scene.run(100.0, Fixed(10.0), unstable="off")
    height = scene.state(crept.end).at((0.0, 1.0), "displacement")[1]
    walls, held = scene.supports[:2], Reaction("top")
    second = scene.after(crept, supports=[*walls, Platen("top", displacement=height)])
    relaxed = second.run(200.0, Fixed(20.0), [held], unstable="off")
    assert held.values[0, 1] == pytest.approx(0.2, abs=1e-9)
    assert held.values[-1, 1] < 0.199
    third = second.after(relaxed, supports=[*walls, Platen("top", force=-held.values[-1, 1])])
    rest = third.run(201.0, Fixed(1e-3), unstable="off")
    assert third.state(rest.end).at((0.7, 1.0), "displacement")[1] == pytest.approx(height, abs=1e-3)
    # not where the body is: a side that is not plane
    bulged = block(charge=Ramp((0, 0.0)), loads=[Traction("top", (0.0, Blend(Ramp((0, 0.0)), Ramp((0, -0.1)), x)))])
    with pytest.raises(InputError, match="the snapshot displaces the body"):
        bulged.after(bulged.run(10.0, Fixed(1.0), unstable="off"), supports=[*walls, Platen("top", force=-0.1)], loads=[])


def test_a_sudden_force_that_nothing_bears_is_named():
    with pytest.raises(StepError, match="the load is sudden"):
        block(Platen("top", force=-50.0), charge=Ramp((0, 0.0))).run(50.0, unstable="off")
