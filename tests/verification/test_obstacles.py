"""Bodies that touch rigid obstacles: closed forms at rest, lift-off, the same as a platen, balance of forces."""

from unittest.mock import patch

import numpy as np
import pytest

from ngswell import (
    TABLE_2,
    Adaptive,
    Axisymmetric,
    Bath,
    Confined,
    LocalDonnan,
    Material,
    Obstacle,
    PlaneStrain,
    Problem,
    Ramp,
    Reaction,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Roller,
    Scene,
    Spatial,
    StepError,
    Symmetry,
    Uncharged,
    box,
    column,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium

DRAINED = Material(mu=0.5, lam=0.5, nS0=0.2, K=1e-3)
STIFFNESS = 2 * TABLE_2.mu + TABLE_2.lam  # N/mm²
CHARGED = Ramp((0, 0.0), (4000, 1.0))
GAP = 0.4
"""mm of a body of 1 mm, which swells by 1.1 mm in 0.3 mol/l where nothing is in the way."""

BODIES = {
    "confined": (Confined(), lambda: column(1.0, 4), [Roller("bottom", "x")]),
    "plane strain": (PlaneStrain(), lambda: rectangle(1, 1, 2, 4), [Symmetry("left|right"), Symmetry("bottom")]),
    "axisymmetric": (Axisymmetric(), lambda: rectangle(1, 1, 2, 4), [Roller("left|right", "r"), Roller("bottom", "z")]),
    "3-d": (
        Spatial(),
        lambda: box(1, 1, 1, 1, 1, 4),
        [Symmetry("left|right"), Symmetry("front|back"), Symmetry("bottom")],
    ),
}
"""Bodies of height 1 that swell along their last direction, with cells of 0.25 mm."""

AREA = {"axisymmetric": np.pi}


def below_a_plate(motion, height=1 + GAP, salt=0.3, **changes):
    kinematics, mesh, supports = BODIES[motion]
    lead = (0.0,) * (kinematics.dimension - 1)
    return Scene(
        **{
            "mesh": mesh(), "kinematics": kinematics, "material": TABLE_2, "supports": supports,
            "baths": [Bath("top", c=salt)], "loads": [Obstacle("top", RigidPlane((*lead, height), (*lead, -2.0)))],
            **changes,
        }
    )  # fmt: skip


@pytest.mark.parametrize("motion", BODIES)
def test_a_gel_that_swells_against_a_plate_has_its_height_and_its_force(motion):
    scene, plate, base = below_a_plate(motion), Reaction("top"), Reaction("bottom")
    found = scene.state(scene.equilibrate(observers=[plate, base])).at((0.5,) * scene.mesh.dim, "J")
    force = plate.values[-1][-1] / AREA.get(motion, 1.0)
    # Homogeneous: exact in the space, Newton's method to round-off. The plate yields by its force over the penalty.
    assert found - 1 - GAP == pytest.approx(force * 0.25 / (1e3 * STIFFNESS), rel=1e-6)
    assert found == pytest.approx(homogeneous_equilibrium(TABLE_2, 0.3, "confined", load=force).J, rel=1e-9)
    assert base.values[-1] == pytest.approx(-plate.values[-1], abs=1e-9)
    assert force > 0.3  # control: it is pressed


@pytest.mark.parametrize("motion", ["confined", "axisymmetric"])
def test_a_plate_that_is_not_reached_does_nothing(motion):
    scene, plate = below_a_plate(motion, height=2.2), Reaction("top")
    found = scene.state(scene.equilibrate(observers=[plate])).at((0.5,) * scene.mesh.dim, "J")
    assert found == pytest.approx(homogeneous_equilibrium(TABLE_2, 0.3, "confined").J, rel=1e-9)
    assert (plate.values == 0.0).all()


def test_the_plate_yields_by_one_over_the_penalty():
    def excess(penalty):
        loads = [Obstacle("top", RigidPlane((1 + GAP,), (-1.0,)), penalty=penalty)]
        scene = below_a_plate("confined", loads=loads)
        return scene.state(scene.equilibrate()).at((0.5,), "J") - 1 - GAP

    assert excess(1e3) < 5e-4
    assert excess(1e3) / excess(1e4) == pytest.approx(10.0, rel=1e-2)  # to first order: the force changes by 1e-3


def test_a_gel_leaves_the_plate_as_its_bath_becomes_salty():
    salt = Ramp((4000, 2.0), (4400, 0.3), (20_000, 0.3), (20_400, 4.1))
    scene = below_a_plate("confined", salt=salt, charge=CHARGED)
    plate = Reaction("top")
    result = scene.run(40_000.0, Adaptive(1e-3), [plate])
    touching = plate.time[plate.values[:, 0] > 0]
    assert 4000 < touching[0] < 20_000 < touching[-1] < 24_000  # salt takes some 3000 s
    pressed = homogeneous_equilibrium(TABLE_2, 0.3, "confined", load=plate.values.max()).J
    assert pressed == pytest.approx(1 + GAP, abs=1e-3)  # penalty 3.6e-4, and what is left of the transient
    assert plate.values[-1, 0] == 0.0
    free = homogeneous_equilibrium(TABLE_2, 4.1, "confined").J
    assert result.state.at((0.5,), "J") == pytest.approx(free, abs=3e-3)  # three times the tolerance
    # The whole face comes to rest at once: steps shorten some twenty times, and not endlessly.
    assert len(result.steps) < 120
    assert sum(len(step.rejected) for step in result.steps) < 60


def test_a_plate_that_moves_is_a_platen():
    down = Ramp((0, 0.0), (100, -0.2), (300, -0.2))
    pieces = {"mesh": column(1.0, 10), "kinematics": Confined(), "material": DRAINED, "model": Uncharged()}
    pieces["baths"] = [Bath("bottom")]
    obstacle = Scene(
        supports=[Roller("bottom", "x")], loads=[Obstacle("top", RigidPlane((1.0,), (-1.0,)), (down,))], **pieces
    )
    platen = Scene(supports=[Roller("bottom", "x"), Roller("top", "x", down)], **pieces)
    at = [50.0, 100.0, 200.0, 300.0]
    forces = []
    for scene in (obstacle, platen):
        top = Reaction("top", when=at)
        scene.run(300.0, Adaptive(1e-5), [top])
        forces.append(top.values[:, 0])
    # The obstacle yields by 0.1 h p/(2µ + λ)/1e3 of 0.2 mm, some 5e-4 of its way; the force follows, and so does its rate.
    np.testing.assert_allclose(*forces, rtol=2e-3)
    assert forces[1].min() > 0.1


def test_a_ring_confines():
    scene = Scene(
        mesh=rectangle(1, 1, 4, 2), kinematics=Axisymmetric(), material=TABLE_2, model=LocalDonnan(),
        supports=[Roller("left", "r"), Roller("bottom", "z")], baths=[Bath("top", c=0.3)],
        loads=[Obstacle("right", RigidPlane((1.0, 0.0), (-1.0, 0.0)), penalty=1e5)],
    )  # fmt: skip
    ring = Reaction("right")
    found = scene.state(scene.equilibrate(observers=[ring])).at((0.5, 0.5), "J")
    # It yields by p h/(2µ + λ)/1e5, some 2e-6 mm, and J by twice that.
    assert found == pytest.approx(homogeneous_equilibrium(TABLE_2, 0.3, "confined").J, rel=2e-5)
    assert ring.values[-1][0] > 1.0


def indented(shape, **changes):
    down = Ramp((0, 0.0), (100, -0.1))
    return Scene(
        **{
            "mesh": rectangle(2.0, 2.0, 8, 8), "kinematics": Axisymmetric(), "material": DRAINED, "model": Uncharged(),
            "supports": [Roller("left", "r"), Roller("bottom", "rz")], "baths": [Bath("right")],
            "loads": [Obstacle("top", shape, (0.0, down))], **changes,
        }
    )  # fmt: skip


def test_a_deep_indentation_at_once_needs_matrices_across_the_kink():
    scene, ball, base = indented(RigidSphere((0.0, 4.0), 2.0)), Reaction("top"), Reaction("bottom")
    scene.equilibrate(100.0, observers=[ball, base], unstable="off")
    assert ball.values[-1][1] == pytest.approx(-base.values[-1][1], rel=1e-8)  # what Newton's method leaves
    assert ball.values[-1][1] > 0.09
    with patch.object(Problem, "kinked", False), pytest.raises(StepError):  # control
        indented(RigidSphere((0.0, 4.0), 2.0), loads=[
            Obstacle("top", RigidSphere((0.0, 4.0), 2.0), (0.0, Ramp((0, 0.0), (100, -0.1))), penalty=1e4)
        ]).equilibrate(100.0, unstable="off")  # fmt: skip


def test_a_bar_in_space_is_the_bar_of_plane_strain():
    flat = Scene(
        mesh=rectangle(1, 1, 4, 4), kinematics=PlaneStrain(), material=DRAINED, model=Uncharged(),
        supports=[Symmetry("left"), Roller("bottom", "xy")], baths=[Bath("right")],
        loads=[Obstacle("top", RigidCylinder((0.0, 1.5), 0.5), (0.0, Ramp((0, 0.0), (1, -0.05))))],
    )  # fmt: skip
    bar = Obstacle("top", RigidCylinder((0.0, 0.0, 1.5), 0.5, (0.0, 3.0, 0.0)), (0.0, 0.0, Ramp((0, 0.0), (1, -0.05))))
    deep = Scene(
        mesh=box(1, 1, 1, 4, 1, 4), kinematics=Spatial(), material=DRAINED, model=Uncharged(),
        supports=[Symmetry("left"), Symmetry("front|back"), Roller("bottom", "xyz")], baths=[Bath("right")], loads=[bar],
    )  # fmt: skip
    forces = []
    for scene in (flat, deep):
        top = Reaction("top")
        scene.equilibrate(1.0, observers=[top], unstable="off")
        forces.append(top.values[-1])
    # The same fields by rules that differ by a degree: 7e-5 here, 1e-5 with 8 cells, where the mesh still changes 6 %.
    assert forces[0] == pytest.approx(forces[1][[0, 2]], rel=1e-4)
    assert forces[0][1] > 0.01
