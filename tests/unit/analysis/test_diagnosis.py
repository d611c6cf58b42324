"""What leaves a scene undetermined is named: before computing where the scene shows it, else when a step fails."""

from dataclasses import replace

import pytest
from netgen.occ import Compound, Glue, MoveTo, Y
from ngsolve import VOL, x, y

from ngswell import (
    TABLE_1,
    Axisymmetric,
    Bath,
    Concentration,
    Fixed,
    InputError,
    PlaneStrain,
    Potential,
    Roller,
    Scene,
    StepError,
    Symmetry,
    Traction,
    Uncharged,
    Weight,
    column,
    from_occ,
    rectangle,
)
from ngswell.analysis.causes import forces_left
from ngswell.analysis.diagnosis import singular_mode
from ngswell.errors import Reason
from ngswell.mesh.parts import Sides
from ngswell.mesh.points import corners, points
from studies.hard_cases.bonded import released_body
from tests.scenes import P0, WITHOUT_IONS, confined_column, strip

MODELS = {
    "Uncharged": (Uncharged(), WITHOUT_IONS, None),
    "Potential": (Potential(), TABLE_1, 0.15),
    "Concentration": (Concentration(), TABLE_1, 0.15),
}
ALL_AROUND = [Roller("left|right", "x"), Roller("bottom|top", "y")]


def two_squares(gap, glue=False):
    lower = MoveTo(0, 0).Rectangle(1, 1).Face()
    lower.edges.Min(Y).name = "bottom"
    upper = MoveTo(0, 1 + gap).Rectangle(1, 1).Face()
    upper.edges.Max(Y).name = "top"
    return from_occ(Glue([lower, upper]) if glue else Compound([lower, upper]), maxh=0.5)


def sealed(model, **changes):
    unknowns, material, salt = MODELS[model]
    fields = {
        "mesh": rectangle(1.0, 1.0, 2, 2),
        "kinematics": PlaneStrain(),
        "material": material,
        "model": unknowns,
        "initial": (salt, 0.0),
        "loads": [Weight((0.0, -1e-3), (0.0, -2e-3))],
    }
    return Scene(**fields | changes)


def gel(mesh, supports, baths):
    return Scene(mesh=mesh, kinematics=PlaneStrain(), material=TABLE_1, supports=supports, baths=baths)


def test_a_part_that_nothing_holds_is_named():
    mesh = two_squares(0.5)
    assert sorted(len(part) for part in Sides(mesh).parts) == [9, 9]
    baths = [Bath("bottom|top", c=0.15)]
    with pytest.raises(InputError, match=r"part near \(0.5, 1.\d+\) mm, one of 2 not connected, can rotate"):
        gel(mesh, [Roller("bottom", "xy")], baths)
    gel(mesh, [Roller("bottom|top", "xy")], baths)
    with pytest.raises(InputError, match="level"):  # the upper part would be sealed and held
        Scene(
            mesh=mesh,
            kinematics=PlaneStrain(),
            material=TABLE_1,
            supports=[Roller("bottom|top|default", "xy")],
            baths=[Bath("bottom", c=0.15)],
        )


def test_parts_that_touch_without_sharing_vertices_are_refused():
    supports, baths = [Roller("bottom|top", "xy")], [Bath("bottom|top", c=0.15)]
    with pytest.raises(InputError, match=r"touch near .* without sharing a side.* merge the vertices"):
        gel(two_squares(0.0), supports, baths)
    gel(two_squares(0.0, glue=True), supports, baths)


@pytest.mark.parametrize("model", MODELS)
def test_a_pressure_without_a_level_is_refused(model):
    with pytest.raises(InputError, match="level of its pressure: give it a bath, or leave a side free"):
        sealed(model, supports=ALL_AROUND)
    # With a free side momentum sets the level; rollers along a side do not hold its volume.
    assert sealed(model, supports=[Roller("left|right", "x"), Roller("bottom", "y")]).run(10.0, Fixed(10.0)).steps
    sealed(model, supports=[Roller("left|right", "xy"), Roller("bottom", "y")])


def test_other_motions_without_change_of_volume_are_refused():
    with pytest.raises(InputError, match="level"):
        confined_column(baths=[], loads=[], supports=[Roller("bottom|top", "x")], initial=(0.15, 0.0))
    with pytest.raises(InputError, match="level"):
        sealed("Uncharged", kinematics=Axisymmetric(), supports=[Roller("left|right", "r"), Roller("bottom|top", "z")])
    assert column(1.0, 3).nv == len(Sides(column(1.0, 3)).parts[0])


@pytest.mark.parametrize(
    ("supports", "words"),
    [
        (ALL_AROUND, "nothing determines the level of [pP]"),
        ([Roller("left|right", "x")], "the body can translate in y"),
    ],
)
@pytest.mark.parametrize("model", MODELS)
def test_a_singular_system_is_named_when_a_step_fails(model, supports, words, monkeypatch):
    # Without the checks of the scene: what else may leave a system undetermined is found in its matrix.
    monkeypatch.setattr("ngswell.setup.setup.check_determined", lambda *arguments: None)
    with pytest.raises(StepError, match=rf"the linear system is singular: {words}.*Remedies: a support") as caught:
        sealed(model, supports=supports).run(100.0, Fixed(10.0))
    assert caught.value.time == 0.0


@pytest.mark.parametrize("dt", [1e-9, 1.0, 1e9, 1e30])
@pytest.mark.parametrize("model", [Concentration(), Potential()])
def test_a_regular_system_is_not_called_singular(model, dt):
    for scene in (strip(None, model=model, cells=(2, 10)), confined_column(None, model=model)):
        problem = scene.problem
        problem.initialise()
        problem.begin_step(dt, dt)
        assert singular_mode(problem) is None


def test_a_cell_that_turns_over_at_a_corner_is_found():
    """J = −0.1 at one corner, and positive at all integration points: a cell turned over where these hold little fluid."""
    for nS0, found in ((0.05, None), (0.11, Reason.TURNS_OVER)):
        problem = strip(mesh=rectangle(1.0, 1.0, 1, 1), loads=[], material=replace(TABLE_1, nS0=nS0)).problem
        problem.initialise()
        # Only the middle of the bottom edge moves: J falls along this edge, to 1 − 1.1 at its end.
        problem.fields.components[0].Set((1.1 * x * (1 - x) * (1 - y), 0 * y))
        assert problem.state.J(problem.mesh(1.0, 0.0)) == pytest.approx(-0.1, abs=1e-12)
        assert problem.state.content(problem.points).min() > 0
        violation = problem.admissible.violation()
        assert (violation and violation.reason) is found
    assert violation.where == pytest.approx((1.0, 0.0))


def crushed(load):
    """Two by two cells, clamped below, held sideways above, pressed: the corner beside the bath is squeezed most."""
    return Scene(
        mesh=rectangle(1.0, 1.0, 2, 2),
        kinematics=PlaneStrain(),
        material=replace(TABLE_1, lam=0.0),
        supports=[Symmetry("left"), Roller("bottom", "xy"), Roller("top", "x")],
        baths=[Bath("right", c=0.15)],
        loads=[Traction("top", (0.0, -load))],
    )


def smallest_at_corners(scene, snapshot):
    return scene.state(snapshot).J(corners(scene.mesh)).min()


def test_a_run_ends_before_a_cell_turns_over(monkeypatch):
    scene = crushed(3.0)
    with pytest.raises(StepError, match="a cell would turn over: J at a cell's corner would not stay positive") as caught:
        scene.run(1e4, Fixed(1e3))
    assert smallest_at_corners(scene, caught.value.end) > 0
    # Control: watched at the forms' own points alone, the run passes with a corner turned inside out, J = −0.24.
    monkeypatch.setattr("ngswell.problem.admissible.corners", lambda mesh: points(mesh, VOL, 6))
    scene = crushed(3.0)
    result = scene.run(1e4, Fixed(1e3))
    assert smallest_at_corners(scene, result.end) < -0.2


# -- starts that are out of balance --------------------------------------------------------------------------------------


@pytest.mark.parametrize("load", [P0, 0.05])
def test_what_a_start_leaves_of_its_forces(load):
    """In balance under p0; under less, the top leaves what the load lacks: (p0 − load)/p0 of the pressure's force."""
    problem = released_body(3, load, "right", Potential()).problem
    problem.initialise()
    assert forces_left(problem)[0] == pytest.approx((P0 - load) / P0, abs=1e-6)  # p0 has seven digits
    assert forces_left(problem)[1][1] == 1.0 or load == P0
