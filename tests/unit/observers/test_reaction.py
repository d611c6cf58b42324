"""Forces on held boundaries, in balance with all loads."""

from math import pi

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    TABLE_2,
    Bath,
    Blend,
    Fixed,
    InputError,
    Integral,
    LocalDonnan,
    Pin,
    PlaneStrain,
    Potential,
    Pressure,
    Ramp,
    Reaction,
    Roller,
    Scene,
    Traction,
    Weight,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import BETWEEN_WALLS

BALANCED = 1e-10
"""N/mm and the like: what Newton's method leaves (corrections below 1e-8, quadratic) of forces of 0.02 to 0.1."""


def at_rest(scene, *boundaries):
    found = [Reaction(boundary) for boundary in boundaries]
    scene.equilibrate(observers=found, unstable="off")
    return [reaction.values[-1] for reaction in found]


def clamped(**changes):
    """A square of Table 1, clamped at its base, with 0.02 N/mm² on its top."""
    return Scene(
        **{
            "mesh": rectangle(1.0, 1.0, 4, 4), "kinematics": PlaneStrain(), "material": TABLE_1, "model": LocalDonnan(),
            "supports": [Roller("bottom", "xy")], "baths": [Bath("top|left|right", c=0.15)],
            "loads": [Traction("top", (0.0, -0.02))], **changes,
        }
    )  # fmt: skip


def test_a_clamped_base_bears_the_load():
    base, stress = Reaction("bottom"), Integral("stress", "bottom")
    clamped().equilibrate(observers=[base, stress], unstable="off")
    assert base.values[-1] == pytest.approx([0.0, -0.02], abs=BALANCED)
    assert abs(stress.values[-1].ravel()[4] + 0.02) > 5e-3  # control: the stress is singular at the corners
    assert list(base.table()) == ["force [N/mm]"]


@pytest.mark.parametrize("order", [["bottom", "left"], ["left", "bottom"]])
def test_supports_together_bear_all_loads(order):
    """Weight, a traction with a history, a bath's pressure on two sides: all that pushes is on the supports."""
    supports = {"bottom": Roller("bottom", "y"), "left": Roller("left", "xy")}
    scene = clamped(
        supports=[supports[name] for name in order],
        baths=[Bath("top|right", c=0.15, P=0.01)],
        loads=[
            Traction("top", (0.01, Blend(Ramp((0, 0.0)), Ramp((0, -0.02)), 0.5))),
            Weight(fluid=(0.0, -1e-2), solid=(0.0, -2e-2)),
        ],
    )
    base, side, both, volume = Reaction("bottom"), Reaction("left"), Reaction("left|bottom"), Integral()
    state = scene.state(scene.equilibrate(observers=[base, side, both, volume], unstable="off"))
    assert both.values[-1] == pytest.approx(base.values[-1] + side.values[-1], abs=1e-15)
    assert base.values[-1][0] == 0.0  # nothing holds it along x
    # ∫ P n over a line is P times the way between its ends, turned: right and top go from the base's end to the left's
    ends = [np.array(p) + state.at(p, "displacement") for p in ((1.0, 0.0), (0.0, 1.0))]
    way = ends[1] - ends[0]
    fluid = volume.values[-1] - TABLE_1.nS0  # of the body, what is not solid; weights are per volume of substance
    loads = np.array([0.01, -0.01 - 1e-2 * fluid - 2e-2 * TABLE_1.nS0]) - 0.01 * np.array([way[1], -way[0]])
    assert both.values[-1] == pytest.approx(loads, abs=BALANCED)


def test_a_pin_counts_with_the_boundary_it_is_on():
    pinned = clamped(supports=[Roller("bottom", "y"), Pin((0.0, 0.0), "x")], loads=[Traction("top", (0.0, -0.02))])
    off = clamped(supports=[Roller("bottom", "y"), Pin((0.0, 1.0), "x")], loads=[Traction("right", (0.01, 0.0))])
    assert at_rest(pinned, "bottom")[0] == pytest.approx([0.0, -0.02], abs=BALANCED)
    assert at_rest(off, "bottom")[0] == pytest.approx([0.0, 0.0], abs=BALANCED)  # the pin itself bears 0.01


MEASURES = {"confined": (0.0, "N/mm²"), "plane strain": (1.0, "N/mm"), "axisymmetric": (2 * pi, "N"), "3-d": (1.0, "N")}
"""Of the bodies between walls: the area of the wall at the right, and the unit of forces."""


@pytest.mark.parametrize("motion", BETWEEN_WALLS)
def test_measures_and_walls(motion):
    """Between walls: the base bears the load on its area, the wall aside the pressure less what the solid bears."""
    (mesh, kinematics, walls, up, base), (side, unit) = BETWEEN_WALLS[motion], MEASURES[motion]
    scene = Scene(
        mesh=mesh(), kinematics=kinematics, material=TABLE_2, model=LocalDonnan(),
        supports=[*walls, Roller("bottom", up)], baths=[Bath("top", c=0.3)], loads=[Pressure("top", 0.05)],
    )  # fmt: skip
    found = {name: Reaction(name) for name in (["bottom", "right"] if side else ["bottom"])}
    scene.equilibrate(observers=list(found.values()), unstable="off")
    assert found["bottom"].values[-1, -1] == pytest.approx(-0.05 * base, abs=BALANCED)
    assert list(found["bottom"].table()) == [f"force [{unit}]"]
    rest = homogeneous_equilibrium(TABLE_2, 0.3, "confined", load=0.05)
    J, nS0, lam = rest.J, TABLE_2.nS0, TABLE_2.lam
    solid = lam * (1 - nS0) ** 2 * (1 / (1 - nS0) - 1 / (J - nS0))  # across nothing stretches: µ (1 − 1)/J and (18)
    if side:
        assert found["right"].values[-1, 0] == pytest.approx((rest.p - solid) * J * side, rel=1e-8)


def test_what_a_bath_bears():
    """What holds the body and the baths that press on it bear nothing together, as there is no other load."""
    scene = clamped(baths=[Bath("top|left|right", c=0.15, P=0.01)], loads=[])
    base, baths = at_rest(scene, "bottom", "top|left|right")
    assert base + baths == pytest.approx([0.0, 0.0], abs=BALANCED)
    assert baths == pytest.approx([0.0, 0.01], abs=1e-14)  # P times the way between the ends of the clamped base, turned


@pytest.mark.parametrize("motion", BETWEEN_WALLS)
def test_what_a_bath_bears_in_its_measure(motion):
    mesh, kinematics, walls, up, base = BETWEEN_WALLS[motion]
    scene = Scene(
        mesh=mesh(), kinematics=kinematics, material=TABLE_2, model=LocalDonnan(),
        supports=[*walls, Roller("bottom", up)], baths=[Bath("top", c=0.3, P=0.05)],
    )  # fmt: skip
    assert at_rest(scene, "top")[0][-1] == pytest.approx(0.05 * base, rel=1e-12)


def test_it_follows_a_run(tmp_path):
    base, kept = Reaction("bottom"), Reaction("bottom", when=[20.0], to=tmp_path / "base.csv")
    scene = clamped(model=Potential(), loads=[Traction("top", (0.0, Ramp((0, 0.0), (20, -0.02))))], charge=Ramp((0, 0.0)))
    scene.run(30.0, Fixed(10.0), [base, kept])
    # in balance at every time: the skeleton bears what the fluid does not
    assert base.values[:, 1] == pytest.approx([0.0, -0.01, -0.02, -0.02], abs=BALANCED)
    assert kept.values == pytest.approx(base.values[2:3], abs=0)


@pytest.mark.parametrize(
    ("boundary", "words"),
    [
        ("top", "nothing is held on 'top'; held boundaries are 'bottom'"),
        ("bottom|left", "nothing is held on 'left'"),
        ("lid", "no boundary 'lid'"),
        ("", "Reaction: boundary has to be a name"),
    ],
)
def test_refused(boundary, words):
    with pytest.raises(InputError, match=words):
        clamped().equilibrate(observers=[Reaction(boundary)], unstable="off")
