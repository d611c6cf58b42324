"""Baths that vary in space prescribe nothing beyond their own values, also where they jump inside a cell."""

import numpy as np
import pytest
from ngsolve import H1, GridFunction, IfPos, sin, x, y

from ngswell import Adaptive, Bath, Blend, PlaneStrain, Potential, Ramp, Roller, Scene, box, rectangle
from ngswell.mesh.points import points_and_corners
from ngswell.problem.bounded import set_bounded
from tests.scenes import UNCHARGED

JUMPS = (0.505, 0.56, 0.61, 0.68, 0.745)
"""Places in the third of four cells."""

MESHES = {
    "quads": lambda: rectangle(1.0, 1.0, 4, 2),
    "triangles": lambda: rectangle(1.0, 1.0, 4, 2, triangles=True),
    "hexahedra": lambda: box(1.0, 1.0, 1.0, 4, 2, 1),
    "tetrahedra": lambda: box(1.0, 1.0, 1.0, 4, 2, 1, "tetrahedra"),
}


def extremes(field, value, region, bounded=True):
    """Least and largest value of what becomes of a field on a boundary, or on the body."""
    mesh = field.space.mesh
    if bounded:
        set_bounded(field, value, region)
    else:
        field.Set(value, definedon=region)
    found = field(points_and_corners(mesh, mesh.Materials(".*") if region is None else region, 12))
    return found.min(), found.max()


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("name", MESHES)
def test_a_jump_inside_a_cell_is_bounded(name, order):
    mesh = MESHES[name]()
    field = GridFunction(H1(mesh, order=order))
    overshoot = 0.0
    for jump in JUMPS:
        value = IfPos(x + 0.1 * y - jump, 0.6, 0.3)
        region = mesh.Boundaries("top")
        low, high = extremes(field, value, region)
        assert low >= 0.3 - 1e-12
        assert high <= 0.6 + 1e-12
        assert high - low > 0.25  # it still jumps
        overshoot = max(overshoot, extremes(field, value, region, bounded=False)[1] - 0.6)
    assert overshoot > 0.03  # negative control: the projection alone


@pytest.mark.parametrize("name", MESHES)
def test_a_jump_inside_the_body_is_bounded(name):
    mesh = MESHES[name]()
    field = GridFunction(H1(mesh, order=2))
    low, high = extremes(field, IfPos(x + 0.1 * y - 0.61, 4.0, 1e-6), None)
    assert low >= 1e-6 - 1e-12
    assert high <= 4.0 + 1e-12


@pytest.mark.parametrize("order", [1, 2])
def test_what_the_functions_hold_stays_as_it_is(order):
    mesh = rectangle(1.0, 1.0, 4, 4)
    plain, bounded = (GridFunction(H1(mesh, order=order)) for _ in range(2))
    top = mesh.Boundaries("top|right")
    plain.Set(0.3 + 0.3 * x**order, definedon=top)
    set_bounded(bounded, 0.3 + 0.3 * x**order, top)
    assert (plain.vec.FV().NumPy() == bounded.vec.FV().NumPy()).all()


def test_away_from_the_jump_the_projection_stays():
    mesh = rectangle(1.0, 1.0, 4, 4)
    plain, bounded = (GridFunction(H1(mesh, order=3)) for _ in range(2))
    value = 0.4 + 0.1 * sin(6 * x) + IfPos(x - 0.61, 0.3, 0.0)
    plain.Set(value, definedon=mesh.Boundaries("top"))
    set_bounded(bounded, value, mesh.Boundaries("top"))
    for place in (0.1, 0.3, 0.45):  # in the first two cells
        assert bounded(mesh(place, 1.0)) == plain(mesh(place, 1.0))
    assert bounded(mesh(0.55, 1.0)) != plain(mesh(0.55, 1.0))


def test_a_bath_from_nearly_pure_water_to_brine_inside_a_cell_runs():
    # The projection alone prescribes c̃ of −0.7 mol/l, and no step succeeds.
    salt = Blend(Ramp((0, 4.0)), Ramp((0, 4.0), (100, 1e-6)), IfPos(x - 0.61, 1.0, 0.0))
    scene = Scene(
        mesh=rectangle(1.0, 1.0, 4, 4), kinematics=PlaneStrain(), material=UNCHARGED, model=Potential(),
        supports=[Roller("bottom", "xy")], baths=[Bath("top", c=salt)],
    )  # fmt: skip
    end = scene.run(100.0, Adaptive(1e-2)).end
    salts = end.values[scene.problem.ranges[scene.model.balanced["cations"]]]
    assert salts[: scene.mesh.nv].min() > 0
    assert np.isfinite(end.values).all()
