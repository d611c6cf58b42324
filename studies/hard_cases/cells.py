"""Slender, nearly flat, distorted and curved cells."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from netgen.occ import WorkPlane, X, Y
from ngsolve import Mesh
from ngsolve.meshes import MakeStructured2DMesh, MakeStructured3DMesh

from ngswell import (
    TABLE_2,
    Area,
    Axisymmetric,
    Bath,
    Essential,
    Fixed,
    InputError,
    Potential,
    Probe,
    Ramp,
    Result,
    Roller,
    Scene,
    box,
    check_mesh,
    from_occ,
    rectangle,
)
from ngswell.baths.treatment import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.models.model import Model
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, AT_REST, directly, free_body, never, off, solid_body
from studies.scenes import COLUMN_HEIGHT, FALLING, confined_column, strip

NEAR_STRAIGHT = 0.7499
"""Place of the middle vertex of `dart`; at 0.75 the cell beside it has a corner of 180°."""


def distorted(cells: int, share: float, triangles: bool = False) -> Mesh:
    """The unit square with inner vertices moved at random, by `share` of the largest scale at which all cells are sound."""
    shifts = np.random.default_rng(0).uniform(-1.0, 1.0, (cells + 1, cells + 1, 2)) / cells
    shifts[[0, -1]] = shifts[:, [0, -1]] = 0.0

    def scaled(scale: float) -> Mesh:
        def place(s: float, t: float) -> tuple[float, float]:
            dx, dy = scale * shifts[round(cells * s), round(cells * t)]
            return s + dx, t + dy

        return MakeStructured2DMesh(quads=not triangles, nx=cells, ny=cells, mapping=place)

    sound, unsound = 0.0, 1.0
    while unsound - sound > 1e-5:
        scale = (sound + unsound) / 2
        try:
            check_mesh(scaled(scale))
            sound = scale
        except InputError:
            unsound = scale
    return scaled(share * sound)


def dart(place: float, triangles: bool = False) -> Mesh:
    """The unit square in 2 × 2 cells whose middle vertex lies at (place, place)."""
    return MakeStructured2DMesh(
        quads=not triangles, nx=2, ny=2, mapping=lambda s, t: (place, place) if (s, t) == (0.5, 0.5) else (s, t)
    )


def quarter_ellipse(half_axis: float, order: int = 2) -> Mesh:
    """A quarter of an ellipse of half-axes `half_axis` and 1 mm in a few triangles, curved with polynomials of `order`."""
    quarter = WorkPlane().Ellipse(half_axis, 1.0).Face() * WorkPlane().Rectangle(half_axis + 1, 2.0).Face()
    quarter.edges.name = "top"
    quarter.edges.Min(X).name = "left"
    quarter.edges.Min(Y).name = "bottom"
    return from_occ(quarter, maxh=2.0, order=order)


def cube_with_moved_corner(place: float) -> Mesh:
    """The unit cube in 2 × 2 × 2 hexahedra whose middle vertex lies at (place, place, place)."""
    middle = (0.5, 0.5, 0.5)
    return MakeStructured3DMesh(
        hexes=True, nx=2, ny=2, nz=2, mapping=lambda r, s, t: (place,) * 3 if (r, s, t) == middle else (r, s, t)
    )


def disc_of_slender_cells(height: float, model: Model, treatment: Treatment) -> Scene:
    """A cylinder of radius 1 mm and this height over its symmetry plane, axisymmetric, bath on top and around."""
    return Scene(
        mesh=rectangle(1.0, height, 4, 4),
        kinematics=Axisymmetric(),
        material=TABLE_2,
        model=model,
        supports=[Roller("left", "r"), Roller("bottom", "z")],
        baths=[Bath("top|right", c=0.3, treatment=treatment)],
    )


def named_as_box(mesh: Mesh) -> Mesh:
    """Sides of MakeStructured3DMesh named as `box` does."""
    for number, name in enumerate(("left", "front", "right", "back", "bottom", "top")):
        mesh.ngmesh.SetBCName(number, name)
    return mesh


HOMOGENEOUS: dict[str, tuple[str, float, Callable[[Model, Treatment], Scene]]] = {
    "1000 : 1 along the bath": ("plane strain", 1e-3, lambda m, t: free_body(rectangle(1.0, 1e-3, 4, 4), m, t)),
    "1000 : 1 across the bath": ("plane strain", 1.0, lambda m, t: free_body(rectangle(1e-3, 1.0, 4, 4), m, t, bath="top")),
    "1e6 : 1": ("plane strain", 1e-6, lambda m, t: free_body(rectangle(1.0, 1e-6, 4, 4), m, t)),
    "triangles 1000 : 1": ("plane strain", 1e-3, lambda m, t: free_body(rectangle(1.0, 1e-3, 4, 4, True), m, t)),
    "distorted": ("plane strain", 1.0, lambda m, t: free_body(distorted(4, 0.999), m, t)),
    "distorted triangles": ("plane strain", 1.0, lambda m, t: free_body(distorted(4, 0.999, True), m, t)),
    "corner of 179.98°": ("plane strain", 1.0, lambda m, t: free_body(dart(NEAR_STRAIGHT), m, t)),
    "triangle's corner of 179.96°": ("plane strain", 1.0, lambda m, t: free_body(dart(NEAR_STRAIGHT, True), m, t)),
    "circle": ("plane strain", 1.0, lambda m, t: free_body(quarter_ellipse(1.0), m, t, bath="top")),
    "ellipse 10 : 1": ("plane strain", 1.0, lambda m, t: free_body(quarter_ellipse(10.0), m, t, bath="top")),
    "axisymmetric 1000 : 1": ("3-d", 1e-3, lambda m, t: disc_of_slender_cells(1e-3, m, t)),
    "axisymmetric 1 : 1000": ("3-d", 1.0, lambda m, t: disc_of_slender_cells(1e3, m, t)),
    "slab 1000 : 1000 : 1": ("3-d", 1e-3, lambda m, t: solid_body(box(1.0, 1.0, 1e-3, 2, 2, 2), m, t)),
    "rod 1 : 1 : 1000": ("3-d", 1e-3, lambda m, t: solid_body(box(1e-3, 1e-3, 1.0, 2, 2, 2), m, t)),
    "distorted hexahedra": ("3-d", 1.0, lambda m, t: solid_body(named_as_box(cube_with_moved_corner(0.62)), m, t)),
}
"""Bodies that swell homogeneously, with the motion of their closed form and the fluid's longest way out [mm]."""

UNSOUND: dict[str, Callable[[Model, Treatment], Scene]] = {
    "corner of 180°": lambda m, t: free_body(dart(0.75), m, t),
    "corner inverted, sound at integration points": lambda m, t: free_body(dart(0.77), m, t),
    "distorted 1 % beyond inversion": lambda m, t: free_body(distorted(4, 1.01), m, t),
    "triangle without area": lambda m, t: free_body(dart(0.75, triangles=True), m, t),
}
"""Meshes that have to be refused."""


def cells(quick: bool) -> list[Attempt]:
    """Slender, nearly flat, distorted and curved cells.

    At rest: homogeneous states lie in every space of isoparametric cells (the geometry's order at most that of u), whatever
    their shape; the error is of Newton's tolerance, times the aspect ratio through the gradient: bound `AT_REST`.
    In transients: strips whose cells are 1000 times wider, or narrower, than high give the column's result, to Newton's
    tolerance, with every treatment (they have to take the cells' size normal to the bath). A square of distorted cells is
    compared with regular ones as large; both errors are of order 2, and the bound is three times that of the regular.
    Unsound meshes have to be refused.
    """
    found = []
    for case, (motion, way, make) in HOMOGENEOUS.items():
        error = off(homogeneous_equilibrium(TABLE_2, 0.3, motion).J)
        for name, choice in DEFAULTS.items():
            body = partial(make, *choice)
            found.append(
                attempt(case, f"{name}, equilibrate", body, 1.0, "volume", error, AT_REST, Fixed(1.0), start=directly)
            )
            if not quick:
                # A thousand times the time of diffusion. Round-off of p opens the ledger by 1e-16 of that ratio.
                step, variant = 1e6 * way**2, f"{name}, huge steps"
                found.append(attempt(case, variant, body, 10 * step, "volume", error, AT_REST, Fixed(step)))
    for case, make in UNSOUND.items():
        for name, choice in DEFAULTS.items():
            found.append(
                attempt(
                    case,
                    name,
                    partial(make, *choice),
                    1.0,
                    "accepting it is wrong",
                    never,
                    0.0,
                )
            )
    return found + strips() + squares(quick)


def parted(strip: Probe, column: Probe, scene: Scene, result: Result) -> float:
    """Largest difference of the displacements of strip and column over the column's largest."""
    found, exact = strip.values["displacement"][:, 1], column.values["displacement"].ravel()
    return float(np.abs(found - exact).max() / np.abs(exact).max())


def strips() -> list[Attempt]:
    """Cells 1000 times wider and narrower than high, between lateral guides: the column's displacement over its largest."""
    found = []
    for name, choice in CHOICES.items():
        exact = Probe((COLUMN_HEIGHT,), "displacement")
        model, treatment = choice
        confined_column(treatment, FALLING, 10, model=model).run(100.0, Fixed(10.0), [exact], newton=ACCURATE)
        for case, width in (("strip 1000 : 1", 50.0), ("strip 1 : 1000", 5e-5)):
            top = Probe((0.0, COLUMN_HEIGHT), "displacement")
            found.append(
                attempt(
                    case,
                    name,
                    partial(strip, treatment, FALLING, (1, 10), width, model=model),
                    100.0,
                    "displacement",
                    partial(parted, top, exact),
                    AT_REST,
                    Fixed(10.0),
                    [top],
                    newton=ACCURATE,
                )
            )
    return found


DILUTED = Ramp((0, 1.0), (100, 0.3))


def square_area(mesh: Mesh, model: Model, treatment: Treatment) -> float:
    """Area [mm²] of the unit square 200 s after its bath began to be diluted."""
    scene, area = free_body(mesh, model, treatment, DILUTED), Area()
    scene.run(200.0, Fixed(20.0), [area], resume=scene.equilibrate())
    return float(area.values[-1])


def missed(area: Area, exact: float, scene: Scene, result: Result) -> float:
    """Relative error of the last area."""
    return abs(float(area.values[-1]) / exact - 1)


def squares(quick: bool) -> list[Attempt]:
    """The area of the unit square swelling freely, on distorted and on nearly flat cells, against a fine graded mesh."""
    number, fine = (4, 8) if quick else (8, 16)
    exact = square_area(rectangle(1.0, 1.0, fine, fine, grade={"top": 10, "right": 10}), Potential(order=3), Essential())
    found = []
    choices = DEFAULTS if quick else CHOICES
    meshes = {"half to inversion": distorted(number, 0.5), "short of inversion": distorted(number, 0.999)}
    for name, choice in choices.items():
        regular = abs(square_area(rectangle(1.0, 1.0, number, number), *choice) / exact - 1)
        for case, mesh in meshes.items():
            area = Area()
            make, error = partial(free_body, mesh, *choice, DILUTED), partial(missed, area, exact)
            until, steps, watched = 200.0, Fixed(20.0), [area]
            found.append(
                attempt(f"swelling, {case}", name, make, until, "area", error, 3 * regular, steps, watched, start=directly)
            )
    return found
