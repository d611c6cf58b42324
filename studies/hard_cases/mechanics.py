"""Hard cases of mechanics and of meshes, for the study `hard_cases`: each family returns attempts, see `studies.hard`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from netgen.occ import WorkPlane, X, Y
from ngsolve import IfPos, Mesh, sqrt, x, y
from ngsolve.meshes import MakeStructured2DMesh, MakeStructured3DMesh
from numpy.typing import NDArray

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Area,
    Axisymmetric,
    Bath,
    Blend,
    Confined,
    Essential,
    Fixed,
    InputError,
    Material,
    Newton,
    PlaneStrain,
    Potential,
    PowerLaw,
    Probe,
    Ramp,
    Result,
    Roller,
    Scene,
    Solid,
    Symmetry,
    Traction,
    box,
    check_mesh,
    column,
    from_occ,
    rectangle,
)
from ngswell.baths.bath import Treatment
from ngswell.closed_forms.homogeneous import FREE_DIRECTIONS, homogeneous_equilibrium
from ngswell.mesh.points import points
from ngswell.models.model import Model
from ngswell.physics import donnan
from ngswell.problem.problem import Snapshot
from ngswell.schedules import Schedule
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt, attempt
from studies.paper import free_swelling
from studies.paper.free_swelling import HEIGHT, INITIAL, SIDE, WIDTH

Choice = tuple[Model, Treatment]

EXACT = Newton()
"""Nonlinear solves to 1e-8, so that ledgers close to round-off and states of rest are as exact as their spaces."""

AT_REST = 1e-6
"""Bound on errors of homogeneous states, which lie in every discrete space: the solves' 1e-8 of the body's length, over
contents down to 1e-2."""


def J_at_points(scene: Scene) -> NDArray:
    """J at integration points of all cells."""
    return scene.problem.state.J(points(scene.mesh, order=4)).ravel()


def off(J: float, least: float = 0.0) -> Callable[[Scene, Result], float]:
    """Largest |J − J₀| over J₀ − least: relative error of the volume, or of the fluid content with least = nS0."""
    return lambda scene, result: float(np.abs(J_at_points(scene) - J).max() / (J - least))


def never(scene: Scene, result: Result) -> float:
    """The error of attempts that must not pass."""
    return np.inf


def missed(area: Area, exact: float, scene: Scene, result: Result) -> float:
    """Relative error of the last area."""
    return abs(float(area.values[-1]) / exact - 1)


def directly(scene: Scene) -> Snapshot:
    """The start of attempts at states of rest by `equilibrate`; the one step after it must not leave them."""
    return scene.equilibrate()


# -- baths that meet at a corner -------------------------------------------------------------------------------------------

APART, STEP = 7400.0, 20.0  # s: when the block is compared, and the steps
OTHER = Ramp((7000, 4.1), (7080, 2.7))  # mol/l: the bottom's bath; the sides' falls on to 0.3 until 7220 s
FINE = {"left": 20.0, "bottom": 20.0, "top": 20.0}


class Corner(NamedTuple):
    """The free-swelling block at 7400 s: area over that at the start, J of the core, displacement of the free top corner,
    rise of the bottom's middle over the corner in which the baths meet [mm]."""

    area: float
    core: float
    far: float
    arch: float


def block_with_corner(
    cells: int,
    model: Model,
    treatment: Treatment,
    width: float = 0.0,
    grade: dict[str, float] | None = None,
    bottom_first: bool = False,
) -> Scene:
    """The block of `free_swelling` with baths that jump where they meet, or blend over `width` [mm]."""
    weak: dict[str, Any] = {"treatment": treatment}
    if width:

        def fading(distance):  # type: ignore[no-untyped-def]
            return 0.5 * IfPos(width - distance, (width - distance) / width, 0.0)

        baths = [Bath("top", c=SIDE, **weak), Bath("left", c=Blend(SIDE, OTHER, fading(y)), **weak)]
        baths.append(Bath("bottom", c=Blend(OTHER, SIDE, fading(x)), **weak))
    else:
        baths = [Bath("top|left", c=SIDE, **weak), Bath("bottom", c=OTHER, **weak)]
    mesh = rectangle(WIDTH, HEIGHT, cells, cells, grade=grade)
    return replace(free_swelling.scene(1, 1), mesh=mesh, model=model, baths=baths[::-1] if bottom_first else baths)


class _Watch:
    def __init__(self) -> None:
        self.area, self.core = Area(), Probe((WIDTH, HEIGHT / 2), "J")
        self.far, self.arch = (Probe(point, "displacement") for point in ((0.0, HEIGHT), (WIDTH, 0.0)))
        self.observers = [self.area, self.core, self.far, self.arch]

    @property
    def end(self) -> Corner:
        moved = (probe.values["displacement"][-1] for probe in (self.far, self.arch))
        far, arch = next(moved)[0], next(moved)[1]
        return Corner(*map(float, (self.area.values[-1] / self.area.values[0], self.core.values["J"][-1], far, arch)))

    def away(self, exact: Corner, scene: Scene, result: Result) -> float:
        return away(self.end, exact)


def at_corner(*arguments: Any, **options: Any) -> Corner:
    """What the block is like at 7400 s; arguments of `block_with_corner`."""
    scene, watch = block_with_corner(*arguments, **options), _Watch()
    scene.run(APART, Fixed(STEP), watch.observers, resume=scene.equilibrate(INITIAL))
    return watch.end


def corner_reference(cells: int, width: float = 0.0, bottom_first: bool = False) -> Corner:
    """Potential of order 3 on a mesh graded towards the baths, with the same time steps."""
    return at_corner(cells, Potential(order=3), Essential(), width, FINE, bottom_first)


def away(found: Corner, exact: Corner) -> float:
    """Largest difference of area, core J and far displacement [mm]: what the corner spoils elsewhere."""
    return max(abs(a - b) for a, b in zip(found[:3], exact[:3], strict=True))


def corner(quick: bool) -> list[Attempt]:
    """Two baths of 0.3 and 2.7 mol/l meet at a corner without a blend: the boundary data jump.

    Compared at 7400 s, with a reference of order 3, graded, in the same time steps: area, core J and the far displacement. A
    jump at a right angle changes the data over one cell, where the flux into the body vanishes with the distance to the
    corner: what it spoils elsewhere goes with h² up to a logarithm, as the discretisation itself. Bound: twice the error of
    the same mesh with the baths blended over the paper's 0.3 mm.
    """
    cells, fine = (5, 10) if quick else (10, 20)
    sharp, blended = corner_reference(fine), corner_reference(fine, 0.3)
    found = []
    for name, choice in CHOICES.items():
        watch = _Watch()
        bound = 2 * away(at_corner(cells, *choice, width=0.3), blended)
        found.append(
            attempt(
                "baths jump at a corner",
                name,
                partial(block_with_corner, cells, *choice),
                APART,
                "area, core J, far displacement",
                partial(watch.away, sharp),
                bound,
                Fixed(STEP),
                watch.observers,
                start=partial(Scene.equilibrate, time=INITIAL),
            )
        )
    return found


def corner_errors(quick: bool) -> list[tuple[Any, ...]]:
    """Rows (variant, cells a side, errors of area, core J, far displacement and arch): orders under refinement.

    "bottom first": in the corner's node the bottom's bath prescribes.
    """
    fine = 10 if quick else 20
    exact, blended = corner_reference(fine), corner_reference(fine, 0.3)
    variants: dict[str, tuple[dict[str, Any], Corner]] = {
        "Potential": ({}, exact),
        "Potential, bottom first": ({"bottom_first": True}, exact),
        "Potential, Penalty": ({}, exact),
        "Concentration": ({}, exact),
        "Potential, blended over 0.3 mm": ({"width": 0.3}, blended),
    }
    rows = []
    for name, (options, reference) in variants.items():
        choice = CHOICES[name if name in CHOICES else "Potential"]
        for cells in (4, 8) if quick else (5, 10, 20):
            ends = at_corner(cells, *choice, **options)
            rows.append((name, cells, *(abs(a - b) for a, b in zip(ends, reference, strict=True))))
    return rows


def corner_widths(quick: bool) -> list[tuple[float, ...]]:
    """Rows (width of the blend [mm], distances of area, core J, far displacement and arch to the jump): references."""
    fine = 10 if quick else 20
    exact = corner_reference(fine)
    widths = (0.3, 0.1) if quick else (0.3, 0.1, 0.03)
    rows = ((width, corner_reference(fine, width)) for width in widths)
    return [(width, *(abs(a - b) for a, b in zip(ends, exact, strict=True))) for width, ends in rows]


def corner_range(cells: int, name: str, bottom_first: bool = False) -> tuple[float, float]:
    """By how much c̃ = √(c₊ c₋) leaves [0.3, 2.7] mol/l within 0.2 mm of the corner at 7400 s: below, above [mol/l]."""
    scene = block_with_corner(cells, *CHOICES[name], bottom_first=bottom_first)
    scene.run(APART, Fixed(STEP), resume=scene.equilibrate(INITIAL))
    where = points(scene.mesh, order=4)
    outputs = scene.problem.state.outputs()
    salt = sqrt(outputs["c_plus"] * outputs["c_minus"])(where).ravel()
    near = np.hypot(x(where).ravel(), y(where).ravel()) < 0.2
    return float(max(0.0, 0.3 - salt[near].min())), float(max(0.0, salt[near].max() - 2.7))


# -- near the compression point and beyond ---------------------------------------------------------------------------------

SQUEEZED = 1e-2
"""Fluid that is left, over that of the reference configuration."""

UNCHARGED = replace(TABLE_1, cfc0=0.0)
SOFT = replace(UNCHARGED, lam=0.0)
SQUEEZABLE: dict[str, Material] = {
    "charged": TABLE_1,
    "charged, λ = 0": replace(TABLE_1, lam=0.0),
    "uncharged": UNCHARGED,
    "charged, K → 0": replace(TABLE_1, permeability=PowerLaw(m=2.0)),
    "uncharged, K → 0": replace(UNCHARGED, permeability=PowerLaw(m=2.0)),
}
BATH = 0.15  # mol/l


def load_at(material: Material, J: float, bath: float = BATH) -> float:
    """Load under which a confined body is at rest at J: the equation of `homogeneous_equilibrium` [N/mm²]."""
    mu, lam, nS0, cfc0 = (material.number(name) for name in ("mu", "lam", "nS0", "cfc0"))
    extra = mu * (J * J - 1) + lam * (1 - nS0) ** 2 * (J / (1 - nS0) - J / (J - nS0))
    return donnan.pressure(bath, (1 - nS0) * cfc0 / (J - nS0), material.RT) - extra / J


def pressed(material: Material, load: float, model: Model, treatment: Treatment, block: bool = False) -> Scene:
    """A column of 0.5 mm, or a block as high between lateral guides, under a load [N/mm²] on its bath's boundary."""
    parts: dict[str, Any] = {"material": material, "model": model, "baths": [Bath("top", c=BATH, treatment=treatment)]}
    if block:
        sides = [Roller("bottom", "y"), Roller("left|right", "x")]
        loads = [Traction("top", (0.0, -load))]
        return Scene(mesh=rectangle(0.5, 0.5, 3, 6), kinematics=PlaneStrain(), supports=sides, loads=loads, **parts)
    supports, loads = [Roller("bottom", "x")], [Traction("top", (-load,))]
    return Scene(mesh=column(0.5, 10), kinematics=Confined(), supports=supports, loads=loads, **parts)


def by_levels(choice: Choice, load: float, levels: int, each: float, scene: Scene) -> Snapshot:
    """A start for the column: after so many levels of `each` [s] from the load of J = 1 to `load`, by equal factors."""
    first, state = load_at(TABLE_1, 1.0), None
    for number in range(levels):
        level = pressed(TABLE_1, first * (load / first) ** (number / levels), *choice)
        state = level.run((number + 1) * each, Adaptive(1e-2), resume=state).end
    assert state is not None
    return state


def compression(quick: bool) -> list[Attempt]:
    """Squeezed to 1 % of its fluid by a load of 2 (uncharged) to 51 N/mm² (charged; 200 times µ), and beyond.

    The load is that of the closed form, at once from the reference configuration, by levels (`resume` from scene to scene),
    in huge steps, and by `equilibrate`. Error: of the fluid content J − nS0 at rest; the state is homogeneous, so `AT_REST`
    bounds it, once it has come to rest. Without charge and λ only µ (1 − nS0²)/nS0 = 0.9 N/mm² resists: loads beyond must
    end in StepError with all contents positive. With charge there is an equilibrium under any load.
    """
    J = TABLE_1.number("nS0") + SQUEEZED * (1 - TABLE_1.number("nS0"))
    error = off(J, TABLE_1.number("nS0"))
    found: list[Attempt] = []

    def add(case: str, variant: str, make: Callable[[], Scene], until: float = 1e5, **options: Any) -> None:
        found.append(attempt(case, variant, make, until, "fluid content", error, AT_REST, newton=EXACT, **options))

    for case, material in SQUEEZABLE.items():
        if quick and case not in ("charged, λ = 0", "uncharged, K → 0"):
            continue
        load = load_at(material, J)
        for name, choice in (CHOICES if material is TABLE_1 and not quick else DEFAULTS).items():
            make = partial(pressed, material, load, *choice)
            end = 1e5 if material.permeability == TABLE_1.permeability else 1e6  # where K falls, rest takes longer
            add(f"1 % left, {case}", f"{name}, at once", make, end, steps=Adaptive(1e-2))
            add(f"1 % left, {case}", f"{name}, huge steps", make, end, steps=Fixed(end / 10))
            add(f"1 % left, {case}", f"{name}, equilibrate", make, 1.0, steps=Fixed(1.0), start=directly)
    load = load_at(TABLE_1, J)
    for name, choice in DEFAULTS.items():
        make = partial(pressed, TABLE_1, load, *choice)
        add("1 % left, charged", f"{name}, by levels", make, start=partial(by_levels, choice, load, 8, 100.0))
        add("1 % left, charged block", f"{name}, at once", partial(make, block=True), steps=Adaptive(1e-2))
    return found + beyond(quick)


def beyond(quick: bool) -> list[Attempt]:
    """Loads under which there is no equilibrium: µ (1 − nS0²)/nS0 and 1 % more, and five times that, at once."""
    nS0 = SOFT.number("nS0")
    limit = SOFT.number("mu") * (1 - nS0**2) / nS0
    found = []
    for case, material in (("", SOFT), (", K → 0", replace(SOFT, permeability=PowerLaw(m=2.0)))):
        for load in (1.01 * limit,) if quick else (1.01 * limit, 5 * limit):
            for name, choice in DEFAULTS.items():
                ways: dict[str, dict[str, Any]] = {
                    "at once": {"steps": Adaptive(1e-2)},
                    "huge steps": {"steps": Fixed(1e4)},
                    "equilibrate": {"steps": Fixed(1.0), "start": directly},
                }
                for way, options in ways.items():
                    if quick and way == "huge steps":
                        continue
                    found.append(
                        attempt(
                            f"no equilibrium, {load:.3g} N/mm²{case}",
                            f"{name}, {way}",
                            partial(pressed, material, load, *choice),
                            1e5,
                            "passing is wrong",
                            never,
                            0.0,
                            newton=EXACT,
                            **options,
                        )
                    )
    return found


# -- swelling by factors of ten to a hundred -------------------------------------------------------------------------------

SALTY, DILUTE = 2.7, 0.1  # mol/l
DILUTIONS = {"at once": 1e-3, "within 1e+04 s": 1e4}  # s


def soft_gel(J: float, motion: str) -> Material:
    """Table 2 with the µ = 6 λ that lets a body of this motion swell to `J` in the dilute bath."""
    charge = (1 - TABLE_2.number("nS0")) * TABLE_2.number("cfc0") / (J - TABLE_2.number("nS0"))
    shape = J ** (2 / FREE_DIRECTIONS[motion]) - 1
    shape += (1 - TABLE_2.number("nS0")) ** 2 / 6 * (J / (1 - TABLE_2.number("nS0")) - J / (J - TABLE_2.number("nS0")))
    mu = J * donnan.pressure(DILUTE, charge, TABLE_2.RT) / shape
    return replace(TABLE_2, mu=mu, lam=mu / 6)


def swelling_body(motion: str, material: Material, cells: int, choice: Choice, c: float | Schedule) -> Scene:
    """A column, a quarter of a block in plane strain, or an eighth of a cube of 1 mm, its other sides in the bath."""
    model, treatment = choice
    if motion == "plane strain":
        return free_body(rectangle(1.0, 1.0, cells, cells), model, treatment, c, material)
    if motion == "3-d":
        return solid_body(box(1.0, 1.0, 1.0, cells, cells, cells), model, treatment, c, material)
    return Scene(
        mesh=column(1.0, cells),
        kinematics=Confined(),
        material=material,
        model=model,
        supports=[Roller("bottom", "x")],
        baths=[Bath("top", c=c, treatment=treatment)],
    )


def swelling(quick: bool) -> list[Attempt]:
    """Gels so soft that they swell to 10, 30 and 100 times their volume, directly and when 2.7 mol/l are diluted to 0.1.

    Error: of the volume at rest against the closed form. The state is homogeneous: `AT_REST` bounds it once it has come to
    rest, which a soft gel takes long to do (up to 1e13 s for a millimetre). A ledger that closes to 1e-7 says that nothing
    was lost on the way. The rim of a free body swells first and is held by its core: where it wrinkles, as on the 2 × 2 × 2
    cells of a cube at J = 30, the tangent without flow has negative eigenvalues (`convergence.undrained`) and the run stops.
    """
    found = []
    for motion, cells in {"confined": 10, "plane strain": 4, "3-d": 2}.items():
        for J in (10.0, 100.0) if quick else (10.0, 30.0, 100.0):
            material = soft_gel(J, motion)
            for name, choice in DEFAULTS.items():
                body = partial(swelling_body, motion, material, cells, choice)
                common: dict[str, Any] = {"measure": "volume", "error": off(J), "bound": AT_REST, "newton": EXACT}
                case, step = f"J = {J:g}, {motion}", Fixed(1.0)
                make = partial(body, DILUTE)
                found.append(attempt(case, f"{name}, equilibrate", make, 1.0, steps=step, start=directly, **common))
                if motion == "3-d" and (quick or J == 100.0):
                    continue
                for way, time in list(DILUTIONS.items())[: 1 if quick else 2]:
                    # The point at 1e6 s only divides the run: steps are refused below 1e-12 of what is left to the next.
                    make = partial(body, Ramp((0, SALTY), (time, DILUTE), (1e6, DILUTE)))
                    steps = Adaptive(1e-2)
                    found.append(attempt(case, f"{name}, {way}", make, 1e13, steps=steps, start=directly, **common))
    return found


# -- slender and distorted cells -------------------------------------------------------------------------------------------

NEAR_STRAIGHT = 0.7499
"""Place of the middle vertex of `dart`; at 0.75 the cell beside it has a corner of 180°."""


def free_body(
    mesh: Mesh,
    model: Model,
    treatment: Treatment,
    c: float | Schedule = 0.3,
    material: Material = TABLE_2,
    bath: str = "top|right",
) -> Scene:
    """A quarter of a body in plane strain, free but for its symmetry planes on the left and at the bottom."""
    return Scene(
        mesh=mesh,
        kinematics=PlaneStrain(),
        material=material,
        model=model,
        supports=[Symmetry("left"), Symmetry("bottom")],
        baths=[Bath(bath, c=c, treatment=treatment)],
    )


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


def solid_body(
    mesh: Mesh, model: Model, treatment: Treatment, c: float | Schedule = 0.3, material: Material = TABLE_2
) -> Scene:
    """An eighth of a block, x = 0, y = 0 and z = 0 being its symmetry planes."""
    return Scene(
        mesh=mesh,
        kinematics=Solid(),
        material=material,
        model=model,
        supports=[Symmetry("left"), Symmetry("front"), Symmetry("bottom")],
        baths=[Bath("top|right|back", c=c, treatment=treatment)],
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


COOLED = Ramp((0, 0.15), (10, 0.125))
"""The bath of Fig. 4 [s, mol/l]."""


def strip(width: float | None, model: Model, treatment: Treatment) -> Scene:
    """The column of Fig. 4 on ten cells, or a strip of this width [mm] between lateral guides in its place."""
    parts: dict[str, Any] = {
        "material": TABLE_1,
        "model": model,
        "baths": [Bath("top", c=COOLED, treatment=treatment)],
    }
    load = load_at(TABLE_1, 1.0)
    if width is None:
        supports, loads = [Roller("bottom", "x")], [Traction("top", (-load,))]
        return Scene(mesh=column(0.5, 10), kinematics=Confined(), supports=supports, loads=loads, **parts)
    sides = [Roller("bottom", "y"), Roller("left|right", "x")]
    loads = [Traction("top", (0.0, -load))]
    return Scene(mesh=rectangle(width, 0.5, 1, 10), kinematics=PlaneStrain(), supports=sides, loads=loads, **parts)


def parted(strip: Probe, column: Probe, scene: Scene, result: Result) -> float:
    """Largest difference of the displacements of strip and column over the column's largest."""
    found, exact = strip.values["displacement"][:, 1], column.values["displacement"].ravel()
    return float(np.abs(found - exact).max() / np.abs(exact).max())


def strips() -> list[Attempt]:
    """Cells 1000 times wider and narrower than high, between lateral guides: the column's displacement over its largest."""
    found = []
    for name, choice in CHOICES.items():
        exact = Probe((0.5,), "displacement")
        strip(None, *choice).run(100.0, Fixed(10.0), [exact], newton=EXACT)
        for case, width in (("strip 1000 : 1", 50.0), ("strip 1 : 1000", 5e-5)):
            top = Probe((0.0, 0.5), "displacement")
            found.append(
                attempt(
                    case,
                    name,
                    partial(strip, width, *choice),
                    100.0,
                    "displacement",
                    partial(parted, top, exact),
                    AT_REST,
                    Fixed(10.0),
                    [top],
                    newton=EXACT,
                )
            )
    return found


DILUTED = Ramp((0, 1.0), (100, 0.3))


def square_area(mesh: Mesh, model: Model, treatment: Treatment) -> float:
    """Area [mm²] of the unit square 200 s after its bath began to be diluted."""
    scene, area = free_body(mesh, model, treatment, DILUTED), Area()
    scene.run(200.0, Fixed(20.0), [area], resume=scene.equilibrate())
    return float(area.values[-1])


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
