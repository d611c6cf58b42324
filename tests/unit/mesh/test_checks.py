"""Cells that no scene takes are refused by number and place; thin ones are sound."""

import pytest
from ngsolve import Mesh
from ngsolve.meshes import MakeStructured2DMesh

from ngswell import TABLE_2, Bath, InputError, PlaneStrain, Roller, Scene, box, check_mesh, column, rectangle


def moved(mesh, number, place):
    """The same mesh with one point moved."""
    points = mesh.ngmesh.Coordinates()
    points[number, : len(place)] = place
    return Mesh(mesh.ngmesh)


@pytest.mark.parametrize(
    ("mesh", "number", "place", "words"),
    [
        (lambda: column(1.0, 4), 1, (0.9,), r"cell 1, a segment near \(0.7\) mm, is turned inside out"),
        (lambda: column(1.0, 4), 1, (0.0,), r"cell 0, a segment near \(0\) mm, has no size"),
        (lambda: rectangle(1.0, 1.0, 3, 3), 5, (0.9, 0.9), "cell .*, a quadrilateral near .* turned inside out"),
        # The corner at (0.77, 0.77) has more than 180°; all integration points of the forms still lie in the sound part.
        (lambda: rectangle(1.0, 1.0, 2, 2), 4, (0.77, 0.77), "a quadrilateral near .* has a corner of 180° or more: move"),
        (lambda: rectangle(1.0, 1.0, 3, 3, triangles=True), 5, (0.9, 0.9), "a triangle near .* turned inside out"),
        (lambda: rectangle(1.0, 1.0, 1, 1, triangles=True), 3, (0.5, 0.5), "cell 1, a triangle near .* no size"),
        (lambda: box(1.0, 1.0, 1.0, 2, 2, 2), 13, (1.4, 1.4, 1.4), "a hexahedron near .* turned inside out, as 6 more"),
        (lambda: box(1.0, 1.0, 1.0, 2, 2, 2, "prisms"), 13, (1.4, 1.4, 1.4), "a prism near .* turned inside out"),
        (lambda: box(1.0, 1.0, 1.0, 2, 2, 2, "tetrahedra"), 13, (1.4, 1.4, 1.4), "a tetrahedron near .* turned inside out"),
    ],
)
def test_bad_cells_are_refused_by_number_and_place(mesh, number, place, words):
    sound = mesh()
    check_mesh(sound)
    with pytest.raises(InputError, match=words):
        check_mesh(moved(sound, number, place))


def test_scenes_check_their_mesh():
    mesh = moved(rectangle(1.0, 1.0, 3, 3), 5, (0.9, 0.9))
    with pytest.raises(InputError, match="turned inside out"):
        Scene(
            mesh=mesh,
            kinematics=PlaneStrain(),
            material=TABLE_2,
            supports=[Roller("bottom", "xy")],
            baths=[Bath("top", c=1.0)],
        )


def test_thin_cells_are_sound():
    # A boundary layer of 1e-8 of the body is thin, not without size; nor does numbering the other way round do harm.
    check_mesh(rectangle(1.0, 1.0, 2, 30, grade={"top": 1e6}))
    check_mesh(moved(column(1.0, 2), 1, (1 - 1e-8,)))
    check_mesh(moved(rectangle(1.0, 1.0, 1, 2, triangles=True), 2, (0.0, 1e-8)))
    check_mesh(MakeStructured2DMesh(nx=2, ny=2, mapping=lambda s, t: (-s, t)))
