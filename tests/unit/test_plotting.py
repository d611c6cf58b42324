"""The picture of a deformed body covers it."""

from math import cos, pi

import numpy as np
import pytest
from ngsolve import CF

from ngswell import TABLE_2, Bath, PlaneStrain, Roller, Scene
from ngswell.plotting import on_deformed_body
from tests.meshes import MESHES, quarter_disc


@pytest.mark.parametrize("name", ["quads", "triangles", "gmsh mixed", "quarter disc"])
def test_picture_of_the_deformed_body(name, tmp_path):
    mesh = quarter_disc() if name == "quarter disc" else MESHES[name][0](tmp_path)
    boundary = "rim" if name == "quarter disc" else "top|right"
    scene = Scene(
        mesh=mesh, kinematics=PlaneStrain(), material=TABLE_2, supports=[Roller("left", "x"), Roller("bottom", "y")],
        baths=[Bath(boundary, c=4.1)],
    )  # fmt: skip
    scene.problem.fields.components[0].Set((0.1 * CF(1), 0.2 * CF(1)))
    picture = on_deformed_body(scene.problem.state, CF(3.0), cuts=4)
    corners = np.stack([picture.mesh.x, picture.mesh.y], 1)[picture.mesh.triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum() / 2
    # The pieces cover the body, up to what their straight sides cut off the rim: chords of at least 12 pieces a quarter.
    exact = pi / 4 if name == "quarter disc" else 2.0
    assert area == pytest.approx(exact, rel=(1 - cos(pi / 24)) if name == "quarter disc" else 1e-12)
    assert picture.outlines.shape == (mesh.ne, 17, 2)
    assert picture.outlines[:, 0] == pytest.approx(picture.outlines[:, -1])
    # Outlines enclose the cells: their shoelace area is the body's.
    x, y = picture.outlines[..., 0], picture.outlines[..., 1]
    enclosed = np.abs((x[:, :-1] * y[:, 1:] - x[:, 1:] * y[:, :-1]).sum(axis=1)).sum() / 2
    assert enclosed == pytest.approx(area, rel=1e-12)
