"""A mesh that changes under a scene is refused, by everything that would compute with it."""

import re

import pytest
from ngsolve import CF, GridFunction, VectorH1, x

from ngswell import Fixed, InputError, rectangle
from tests.scenes import quarter

REFINED = r"changed since the scene was made \(cells 8 then, 32 now\): make the scene after"


def deform(mesh):
    field = GridFunction(VectorH1(mesh))
    field.Set(CF((0.1 * x, 0.0)))
    mesh.SetDeformation(field)


def move(mesh):
    mesh.ngmesh.Coordinates()[4, :2] += 0.01


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda mesh: mesh.Refine(), REFINED),
        (lambda mesh: mesh.Curve(3), "order of the curved sides 1 then, 3 now"),
        (deform, r"has a deformation.*UnsetDeformation\(\)"),
        (move, "points or names"),
        (lambda mesh: mesh.ngmesh.SetBCName(0, "other"), "points or names"),
    ],
)
def test_refused_at_the_start_of_each_run(change, words):
    mesh = rectangle(1.0, 1.0, 2, 2, triangles=True)
    scene = quarter(mesh=mesh, c=2.0)
    scene.problem  # noqa: B018  a cached problem is no way around
    result = scene.run(1.0, Fixed(1.0))
    before = result.state.at((0.5, 0.5), "J")
    assert before == result.state.at((0.5, 0.5), "J")
    change(mesh)
    for use in (
        lambda: scene.run(1.0, Fixed(1.0)),
        lambda: scene.run(2.0, Fixed(1.0), resume=result.end),
        scene.equilibrate,
        lambda: scene.growth_factor(1.0),
        scene.describe,
        lambda: scene.state(result.end),
        lambda: result.state.at((0.5, 0.5), "J"),
    ):
        with pytest.raises(InputError, match=words):
            use()


def test_a_scene_made_after_the_change_runs():
    mesh = rectangle(1.0, 1.0, 2, 2, triangles=True)
    mesh.Refine()
    assert quarter(mesh=mesh, c=2.0).run(1.0, Fixed(1.0)).steps
    deform(mesh)
    with pytest.raises(InputError, match=re.escape("call mesh.UnsetDeformation() first")):
        quarter(mesh=mesh, c=2.0)
    mesh.UnsetDeformation()
    assert quarter(mesh=mesh, c=2.0).run(1.0, Fixed(1.0)).steps
