"""Obstacles: distances of the shapes, and what is refused."""

import numpy as np
import pytest
from ngsolve import CF

from ngswell import (
    TABLE_1,
    Axisymmetric,
    Bath,
    Blend,
    Confined,
    Fixed,
    InputError,
    LocalDonnan,
    Obstacle,
    OverlapWarning,
    PlaneStrain,
    Ramp,
    Reaction,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Roller,
    Scene,
    Spatial,
    Symmetry,
    box,
    column,
    rectangle,
)

MESHES = {
    Confined: lambda: column(1.0, 2),
    PlaneStrain: lambda: rectangle(1, 1, 2, 2),
    Axisymmetric: lambda: rectangle(1, 1, 2, 2),
    Spatial: lambda: box(1, 1, 1, 1, 1, 1),
}
SUPPORTS = {
    Confined: [Roller("bottom", "x")],
    PlaneStrain: [Roller("bottom", "xy")],
    Axisymmetric: [Roller("left", "r"), Roller("bottom", "z")],
    Spatial: [Roller("bottom", "xyz")],
}
FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))
CEILING = RigidPlane((0.0, 1.2), (0.0, -1.0))


def scene(*loads, motion=PlaneStrain, **changes):
    return Scene(
        **{
            "mesh": MESHES[motion](), "kinematics": motion(), "material": TABLE_1, "model": LocalDonnan(),
            "supports": SUPPORTS[motion], "baths": [Bath("top", c=0.15)], "loads": loads, **changes,
        }
    )  # fmt: skip


SHAPES = [
    (RigidPlane((0.0, 0.0, 1.0), (0.0, 3.0, 4.0)), 0.6 * 2.0 + 0.8 * (3.0 - 1.0), (0.0, 0.6, 0.8)),
    (RigidSphere((1.0, 0.0, 3.0), 0.5), 1.5, (0.0, 1.0, 0.0)),
    (RigidCylinder((0.0, 0.0, 0.0), 3.0, (9.0, 0.0, 0.0)), np.sqrt(13) - 3, (0.0, 2 / np.sqrt(13), 3 / np.sqrt(13))),
]


@pytest.mark.parametrize(("shape", "distance", "away"), SHAPES)
def test_distances(shape, distance, away):
    mesh = box(1, 1, 1, 1, 1, 1)
    point = mesh(0.5, 0.5, 0.5)  # any
    gap, gradient = shape.gap(CF(tuple(np.array((1.0, 2.0, 3.0)) - shape.at)))
    assert gap(point) == pytest.approx(distance, abs=1e-14)
    assert gradient(point) == pytest.approx(away, abs=1e-14)


REFUSED = [
    (lambda: RigidPlane((0.0, 1.0), (0.0, 0.0)), "RigidPlane: normal .* has no length"),
    (lambda: RigidPlane((0.0, 1.0), (0.0, 0.0, 1.0)), "RigidPlane: normal .* needs as many components as the point"),
    (lambda: RigidSphere((0.0, 1.0), 0.0), "RigidSphere: radius has to be positive"),
    (lambda: RigidCylinder((0.0, 1.0), -1.0), "RigidCylinder: radius has to be positive"),
    (lambda: RigidCylinder((0.0, 1.0, 0.0), 1.0, (0.0, 0.0, 0.0)), "RigidCylinder: axis .* has no length"),
    (lambda: Obstacle("top", "plane"), "Obstacle: shape has to be a RigidPlane, a RigidSphere or a RigidCylinder"),
    (lambda: Obstacle("top", CEILING, -0.1), "Obstacle: displacement has to be 2 numbers or histories"),
    (lambda: Obstacle("top", CEILING, (0.0,)), "Obstacle: displacement has to be 2 numbers or histories"),
    (lambda: Obstacle("top", CEILING, penalty=0.0), "Obstacle: penalty"),
    (
        lambda: Obstacle("top", CEILING, (0.0, Blend(Ramp((0, 0.0)), Ramp((0, 1.0)), 0.5))),
        "displacement varies in space; the obstacle is rigid",
    ),
    (lambda: scene(Obstacle("lid", CEILING)), "Obstacle: the mesh has no boundary 'lid'"),
    (lambda: scene(Obstacle("top", RigidPlane((1.2,), (-1.0,)))), "needs 2 coordinates"),
    (lambda: scene(Obstacle("top", RigidPlane((0.0, 0.9), (0.0, -1.0)))), r"overlaps the body by 0.1 mm near \(\S+, 1\) mm"),
    (lambda: scene(Obstacle("top", RigidPlane((0.0, 1.2), (0.0, 1.0)))), "overlaps the body by 0.2 mm"),  # the wrong side
    (lambda: scene(Obstacle("top", CEILING, (0.0, -0.3))), "overlaps the body by 0.1 mm"),
    (lambda: scene(Obstacle("bottom", RigidPlane((0.0, -1.0), (0.0, 1.0)))), "a support holds it where the obstacle pushes"),
    (
        lambda: scene(Obstacle("top", RigidSphere((0.0, 3.0), 1.0))),
        r"in plane strain take RigidCylinder\(at, radius\)",
    ),
    (lambda: scene(Obstacle("top", RigidSphere((3.0,), 1.0)), motion=Confined), r"RigidSphere: a column meets a RigidPlane"),
    (lambda: scene(Obstacle("top", RigidCylinder((0.0, 3.0), 1.0, (0.0, 1.0)))), "axis is across the plane; leave axis out"),
    (
        lambda: scene(Obstacle("top", RigidCylinder((0.0, 3.0), 1.0)), motion=Axisymmetric),
        "for plane strain and space",
    ),
    (lambda: scene(Obstacle("top", RigidCylinder((0.0, 0.0, 3.0), 1.0)), motion=Spatial), "in space it needs an axis"),
    (lambda: scene(Obstacle("top", RigidSphere((0.1, 3.0), 1.0)), motion=Axisymmetric), "it lies on the axis"),
    (
        lambda: scene(Obstacle("top", RigidSphere((0.0, 3.0), 1.0), (Ramp((0, 0.0), (1, 0.1)), 0.0)), motion=Axisymmetric),
        "its displacement along r has to be 0.0",
    ),
    # A plate on which a body lies does not hold it.
    (
        lambda: scene(Obstacle("bottom", FLOOR), supports=[Symmetry("left")]),
        "can translate in y",
    ),
]


@pytest.mark.parametrize(("make", "message"), REFUSED)
def test_what_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_what_touches_at_the_start_is_not():
    scene(Obstacle("top", RigidPlane((0.0, 1.0), (0.0, -1.0))), Obstacle("right", RigidPlane((1.0, 0.0), (-1.0, 0.0))))


def test_an_obstacle_put_into_a_deformed_body_is_refused():
    gel = scene()
    end = gel.equilibrate()  # it swells
    height = 1 + gel.state(end).at((0.5, 1.0), "displacement")[1]
    assert height > 1.01

    def below(y):
        return gel.after(end, loads=[Obstacle("top", RigidPlane((0.0, y), (0.0, -1.0)))], start=0.0)

    with pytest.raises(InputError, match=r"at the start \(0 s\) it overlaps the body by \S+ mm near"):
        below(height - 0.01).run(1.0, Fixed(1.0))
    pressed = below(height + 0.01).run(1.0, Fixed(1.0)).end
    below(height + 0.01).run(2.0, Fixed(1.0), resume=pressed)


def test_a_side_within_an_obstacle_that_it_does_not_touch_is_told():
    """A gel that swells sideways into a wall, which only its top would touch."""
    wall = RigidPlane((1.02, 0.0), (-1.0, 0.0))
    with pytest.warns(OverlapWarning, match=r"'right' is \S+ mm within the obstacle on 'top' near .*'top\|right'"):
        scene(Obstacle("top", wall)).equilibrate()

    def bulge(gel):
        state = gel.state(gel.equilibrate())
        return max(state.at((1.0, height), "displacement")[0] for height in np.linspace(0.1, 1.0, 10))

    # What it advises, without a warning: a penalty of 1000 yields by thousandths of a cell of 0.5 mm.
    assert bulge(scene(Obstacle("top|right", wall))) < 0.021 < 0.03 < bulge(scene())


def test_reaction_asks_for_something_to_push_at():
    with pytest.raises(InputError, match="held boundaries are 'bottom', those with an obstacle 'top'"):
        scene(Obstacle("top", CEILING)).equilibrate(observers=[Reaction("right")])


def test_describe_names_it():
    assert "obstacle on top" in scene(Obstacle("top", CEILING)).describe()
