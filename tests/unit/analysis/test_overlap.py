"""A body that covers a place twice is reported, with the place; one that comes close is not."""

import warnings
from dataclasses import replace
from math import pi

import numpy as np
import pytest
from matplotlib.path import Path
from ngsolve import CF, IfPos, cos, sin, x, y, z

from ngswell import (
    TABLE_1,
    Adaptive,
    Bath,
    Fixed,
    LocalDonnan,
    OverlapWarning,
    PlaneStrain,
    Ramp,
    Roller,
    Scene,
    Spatial,
    box,
    rectangle,
)
from ngswell.analysis.overlap import overlap, warn_of_overlap
from ngswell.problem.problem import Problem
from tests.scenes import confined_column, quarter

LENGTH, HEIGHT = 6.0, 0.4  # mm


def curled(turns, space=False, cells=48, pitch=0.0):
    """A strip bent to `turns` of a circle, its radius growing by `pitch` [mm] a turn, and its problem."""
    if space:
        mesh = box(LENGTH, HEIGHT, 0.5, cells, 2, 1, "prisms")
        kinematics, held = Spatial(), "xyz"
    else:
        mesh, kinematics, held = rectangle(LENGTH, HEIGHT, cells, 2), PlaneStrain(), "xy"
    scene = Scene(
        mesh=mesh, kinematics=kinematics, material=TABLE_1, model=LocalDonnan(), supports=[Roller("left", held)],
        baths=[Bath("top", c=0.15)],
    )  # fmt: skip
    problem = Problem(scene)
    problem.initialise()
    angle = 2 * pi * turns * x / LENGTH
    radius = LENGTH / (2 * pi * turns) + pitch * angle / (2 * pi) - y
    bent = (radius * sin(angle) - x, LENGTH / (2 * pi * turns) - radius * cos(angle) - y)
    problem.fields.components[0].Set(CF((*bent, 0 * z) if space else bent))
    return problem


@pytest.mark.parametrize("space", [False, True])
def test_a_strip_that_curls_into_itself_is_named(space):
    problem = curled(1.13, space)
    found = overlap(problem, problem.snapshot(0.0))
    # Its first and last 0.13 of 1.13 turns lie on each other: cells of two rows (and two triangles in space) at either end.
    covered = 2 * round(48 * 0.13 / 1.13) * 2 * (2 if space else 1)
    assert abs(found.cells - covered) <= 8
    along = found.where[0]
    assert min(along, LENGTH - along) < LENGTH * 0.13 / 1.13
    with pytest.warns(OverlapWarning, match=r"overlaps itself: \d+ of \d+ cells .* Contact is not modelled.* Remedies: "):
        warn_of_overlap(problem, problem.snapshot(0.0))


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize(("turns", "pitch"), [(0.98, 0.0), (1.6, 0.5), (0.0001, 0.0)])
def test_a_strip_that_comes_close_is_not(turns, pitch, space):
    # A gap of 0.12 mm, or a spiral with gaps of 0.1 mm, in a body of 0.4 mm.
    problem = curled(turns, space, cells=24, pitch=pitch)
    assert overlap(problem, problem.snapshot(0.0)) is None


def test_swollen_bodies_do_not_overlap():
    with warnings.catch_warnings():
        warnings.simplefilter("error", OverlapWarning)
        quarter(c=2.0).equilibrate()
        confined_column(cells=2).run(1.0, Fixed(1.0))


def covered_twice(problem, snapshot):
    """Share of the covered area that is covered twice or more, by counting cells over a raster of places."""
    places = np.array([vertex.point for vertex in problem.mesh.vertices]) + problem.vertex_values(snapshot.values, "u").T
    lines = [np.linspace(*limits, 200) for limits in zip(places.min(axis=0), places.max(axis=0), strict=True)]
    raster = np.stack(np.meshgrid(*lines), -1).reshape(-1, 2)
    outlines = [places[[vertex.nr for vertex in cell.vertices]] for cell in problem.mesh.Elements()]
    times = np.sum([Path(outline).contains_points(raster) for outline in outlines], axis=0)
    return (times > 1).sum() / (times > 0).sum()


def curling(bath):
    layered = replace(TABLE_1, mu=0.1, cfc0=IfPos(y - 0.05, 0.35, 0.02))
    return Scene(
        mesh=rectangle(1.2, 0.1, 10, 2), kinematics=PlaneStrain(), material=layered, model=LocalDonnan(),
        supports=[Roller("left", "xy")], baths=[Bath("top|right|bottom", c=bath)], charge=Ramp((0, 0.0), (10, 1.0)),
    )  # fmt: skip


def test_a_bilayer_that_curls_into_itself_is_reported():
    scene = curling(Ramp((0, 2.0), (60, 0.1)))
    with pytest.warns(OverlapWarning, match="the body overlaps itself: ") as caught:
        end = scene.run(100.0, Adaptive(0.2)).end
    assert [warning.filename for warning in caught] == [__file__]  # once
    found, twice = overlap(scene.problem, end), covered_twice(scene.problem, end)
    assert twice > 0.1
    # Each such area belongs to two cells; ten cells along the strip resolve it to one of them at each end and row.
    assert found.cells / found.looked_at == pytest.approx(2 * twice / (1 + twice), abs=0.2)


@pytest.mark.parametrize("solves", [100, 10**9])
def test_one_that_uncurls_again_is_seen_on_the_way(solves, monkeypatch):
    monkeypatch.setattr("ngswell.analysis.overlap.SOLVES", solves)
    scene = curling(Ramp((0, 2.0), (60, 0.1), (80, 0.1), (120, 2.0)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        end = scene.run(200.0, Adaptive(0.2), unstable="off").end
    assert overlap(scene.problem, end) is None
    assert [warning.category for warning in caught] == [OverlapWarning] * (solves == 100)  # control: a look at the end only
