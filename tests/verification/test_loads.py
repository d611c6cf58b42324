"""Tractions with histories and in space, and pressures that follow the surface."""

from math import pi, sin

import pytest
from ngsolve import Parameter, x

from ngswell import (
    TABLE_1,
    TABLE_2,
    Bath,
    Blend,
    Confined,
    Fixed,
    InputError,
    LocalDonnan,
    PlaneStrain,
    Pressure,
    Probe,
    Ramp,
    Roller,
    Scene,
    Sine,
    Symmetry,
    Traction,
    Uncharged,
    column,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import CLOSED, FREE, WITHOUT_IONS

LOAD = 0.05  # N/mm²


def pressed(*loads, **changes):
    """A column in its bath."""
    return Scene(
        **{
            "mesh": column(0.5, 3), "kinematics": Confined(), "material": TABLE_1, "model": LocalDonnan(),
            "supports": [Roller("bottom", "x")], "baths": [Bath("top", c=0.15)], "loads": loads, **changes,
        }
    )  # fmt: skip


# -- tractions ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("time", "share"), [(-1.0, 0.0), (25.0, 0.25), (200.0, 1.0)])
def test_a_ramped_traction_comes_to_the_closed_form(time, share):
    scene = pressed(Traction("top", (Ramp((0, 0.0), (100, -LOAD)),)))
    found = scene.state(scene.equilibrate(time)).at((0.25,), "J")
    exact = homogeneous_equilibrium(TABLE_1, 0.15, "confined", load=share * LOAD).J
    assert found == pytest.approx(exact, rel=1e-10)  # homogeneous: exact in the space, Newton's method to round-off


def test_a_run_follows_a_ramped_traction_to_rest():
    start = homogeneous_equilibrium(TABLE_1, 0.15, "confined").J
    scene = pressed(Traction("top", (Ramp((0, 0.0), (105, -LOAD)),)), start=-1e5)
    probe = Probe((0.25,), "J")
    result = scene.run(1e5, Fixed(1e4), [probe])
    assert {0.0, 105.0} <= {step.time for step in result.steps}  # steps land on the kinks
    assert probe.values["J"][9] == pytest.approx(start, rel=1e-8)
    # 200 s consolidate the column (L²/(HK) with H about 0.5): steps of 1e4 s leave less than Newton's tolerance
    exact = homogeneous_equilibrium(TABLE_1, 0.15, "confined", load=LOAD).J
    assert probe.values["J"][-1] == pytest.approx(exact, rel=1e-8)
    assert exact < start - 0.05


def test_a_sine_traction_is_that_of_a_ramp_through_its_points():
    """Backward Euler sees loads at the ends of steps only, where both are the same number."""
    sine = Sine(-LOAD, LOAD / 2, period=40.0, cycles=1)
    points = [(time, -LOAD + LOAD / 2 * sin(2 * pi * time / 40)) for time in range(41)]
    found = []
    for history in (sine, Ramp(*points), -LOAD):
        probe = Probe((0.5,), "displacement", "J")
        pressed(Traction("top", (history,))).run(50.0, Fixed(1.0), [probe], unstable="off")
        found.append(probe.values["displacement"].ravel())
    assert found[0] == pytest.approx(found[1], abs=1e-9)  # Newton's tolerance of displacements of 0.5 mm
    assert abs(found[0] - found[2]).max() > 1e-3  # control: without its oscillation


def test_a_traction_varies_in_space():
    """A traction that grows along the top of a strip between guides."""
    strip = {"mesh": rectangle(1.0, 0.5, 2, 2), "kinematics": PlaneStrain()}
    supports = [Roller("bottom", "xy"), Roller("left|right", "x")]
    ends = []
    for entry in (Blend(Ramp((0, 0.0)), Ramp((0, -LOAD)), x), Blend(Ramp((0, -LOAD)), Ramp((0, 0.0)), 1 - x)):
        scene = pressed(Traction("top", (0.0, entry)), supports=supports, **strip)
        state = scene.state(scene.equilibrate())
        ends.append([state.at((place, 0.5), "displacement")[1] for place in (0.0, 1.0)])
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)  # the same field, written in two ways
    assert ends[0][0] > ends[0][1] + 1e-3  # lower where the load is


# -- pressures ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", FREE)
def test_a_pressure_comes_to_the_closed_form(motion):
    mesh, kinematics, supports, free = FREE[motion]
    scene = Scene(
        mesh=mesh(), kinematics=kinematics, material=TABLE_2, model=LocalDonnan(), supports=supports,
        baths=[Bath(free, c=0.3)], loads=[Pressure(free, Ramp((0, 0.0), (100, LOAD)))],
    )  # fmt: skip
    middle = (0.5,) * scene.mesh.dim
    for time, load in ((0.0, 0.0), (50.0, LOAD / 2), (100.0, LOAD)):
        found = scene.state(scene.equilibrate(time)).at(middle, "J")
        # homogeneous: exact in the space, Newton's method to round-off
        assert found == pytest.approx(homogeneous_equilibrium(TABLE_2, 0.3, CLOSED[motion], load=load).J, rel=1e-10)


@pytest.mark.parametrize("load", ["pressure", "bath"])
def test_a_column_may_be_pressed_at_either_end(load):
    """The normal points outwards at both ends, and Newton's matrix has it: as many iterations."""
    ends = []
    for wet, held in (("top", "bottom"), ("bottom", "top")):
        bath = Bath(wet, P=0.01 if load == "bath" else 0.0)
        scene = Scene(
            mesh=column(0.5, 4), kinematics=Confined(), material=WITHOUT_IONS, model=Uncharged(),
            supports=[Roller(held, "x")], baths=[bath], initial=(None, 0.0),
            loads=[Pressure(wet, 0.05)] if load == "pressure" else [],
        )  # fmt: skip
        result = scene.run(100.0, Fixed(20.0))
        J = [result.state.at((place,), "J") for place in (0.1, 0.4)]
        ends.append((J if wet == "top" else J[::-1], [step.iterations for step in result.steps]))
    assert ends[0][0] == pytest.approx(ends[1][0], rel=1e-9)
    assert ends[0][1] == ends[1][1]
    moved = abs(ends[0][0][1] - 1)  # near the wet end
    assert moved > 1e-3 if load == "pressure" else moved < 1e-9  # a bath squeezes no incompressible constituents


def test_a_pressure_is_what_a_bath_presses_with():
    """What a porous plate takes off the body, a pressure puts on again."""
    plated = pressed(Pressure("top", LOAD), baths=[Bath("top", c=0.15, P=LOAD, porous_plate=True)])
    bath = pressed(baths=[Bath("top", c=0.15, P=LOAD)])
    ends = [scene.equilibrate().values for scene in (plated, bath)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


# -- refusals ----------------------------------------------------------------------------------------------------------

SQUARE = {"mesh": rectangle(1, 1, 2, 2), "kinematics": PlaneStrain(), "supports": [Symmetry("bottom"), Symmetry("left")]}


@pytest.mark.parametrize(
    ("loads", "words"),
    [
        (lambda: [Traction("top", (0.0, Ramp((0, 0.0), (1, 2e3))))], "component 2000.0 N/mm².*±1000"),
        (lambda: [Traction("top", (0.0, Ramp))], "component <class"),
        (lambda: [Traction("top", Ramp((0, 0.0)))], "some numbers"),
        (lambda: [Traction("top", (Ramp((0, 0.0)),))], "2 components"),
        (lambda: [Traction("left", (Ramp((0, 0.0), (1, -0.1)), 0.0))], "holds it in x"),
        (lambda: [Traction("top", (0.0, Blend(Ramp((0, 0.0)), Ramp((0, -0.1)), 2 * x)))], "Blend: weight = 1.*is outside"),
        (lambda: [Pressure("lid", 0.1)], "Pressure: the mesh has no boundary 'lid'"),
        (lambda: [Pressure("", 0.1)], "Pressure: boundary has to be a name"),
        (lambda: [Pressure("top", 1e5)], "Pressure: P = 100000 N/mm² is outside -1000 … 1000: 1 N/mm² = 1e6 Pa"),
        (lambda: [Pressure("top", "0.1")], "Pressure: P .* has to be a number"),
        (lambda: [Pressure("top|left", 0.1)], "Pressure on 'left': a support holds it along its normal"),
    ],
)
def test_refused(loads, words):
    with pytest.raises(InputError, match=words):
        pressed(*loads(), **SQUARE)


def test_fields_of_loads_that_change_are_noticed():
    share = Parameter(0.5)
    scene = pressed(Traction("top", (0.0, Blend(Ramp((0, 0.0)), Ramp((0, -0.1)), share))), **SQUARE)
    share.Set(0.7)
    with pytest.raises(InputError, match=r"a history of loads\[0\] has changed"):
        scene.equilibrate()
