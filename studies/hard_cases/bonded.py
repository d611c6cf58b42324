"""Gels bonded to a rigid base beside a wet side, where the strain is singular; bodies whose load is released at once."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from ngsolve import Mesh

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Axisymmetric,
    Bath,
    Fixed,
    LocalDonnan,
    Material,
    PlaneStrain,
    Potential,
    Ramp,
    Result,
    Roller,
    Scene,
    Symmetry,
    Traction,
    rectangle,
)
from ngswell.baths.treatment import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.models.model import Model
from ngswell.physics.kinematics import Kinematics
from ngswell.setup.snapshot import Snapshot
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, AT_REST, directly, off
from studies.scenes import BATH, P0

SEEN = 2e-3
"""Bound on the rise of the top, over the height: what can be seen. The singular edge costs order 2 less than that, and more
the coarser the cells: 1.4e-3 on the coarsest disc."""


def square(cells: int, grade: float) -> Mesh:
    """The unit square, with fine cells at the bottom and at the right."""
    return rectangle(1.0, 1.0, cells, cells, grade={"bottom": grade, "right": grade})


def on_base(
    mesh: Mesh,
    model: Model,
    treatment: Treatment | None = None,
    material: Material = TABLE_1,
    kinematics: Kinematics | None = None,
    **changes: Any,
) -> Scene:
    """Half a body on a rigid base, wet above and beside."""
    motion = kinematics or PlaneStrain()
    salt = BATH if material is TABLE_1 else 1.0
    parts: dict[str, Any] = {"baths": [Bath("top|right", c=salt, treatment=treatment)], **changes}
    supports = [Roller("bottom", "".join(motion.directions)), Symmetry("left")]
    return Scene(mesh=mesh, kinematics=motion, material=material, model=model, supports=supports, **parts)


def reference(of: Callable[[], Mesh], material: Material, kinematics: Kinematics) -> float:
    """Rise of the middle of the top [mm], with order 3."""
    scene = on_base(of(), Potential(order=3), material=material, kinematics=kinematics)
    return top(scene, scene.equilibrate().values)


def top(scene: Scene, values: Any) -> float:
    problem = scene.problem
    problem.vector[:] = values
    corner = (0.0, max(vertex.point[1] for vertex in scene.mesh.vertices))
    return float(problem.fields.components[0](scene.mesh(*corner))[1])


def missed(exact: float, height: float, scene: Scene, result: Result) -> float:
    """Distance of the rise from the reference, over the height."""
    return abs(top(scene, result.end.values) - exact) / height


def bonded(quick: bool) -> list[Attempt]:
    """The rise of the top at rest, on meshes that resolve more and more of the singular edge, by `equilibrate` and by a run.

    Against order 3 on finer cells. Bound: `SEEN`.
    """
    plane, disc = PlaneStrain(), Axisymmetric()
    fine, halves = partial(square, 12, 25.0), partial(rectangle, 1.0, 0.5, *((12, 6) if quick else (16, 8)))
    references = {plane: reference(fine, TABLE_1, plane), disc: reference(halves, TABLE_2, disc)}
    cases: list[tuple[str, Mesh, float, Material, Kinematics]] = [
        (f"Table 1, {cells} × {cells}, graded {grade:g}", square(cells, grade), 1.0, TABLE_1, plane)
        for cells, grade in ((8, 25.0), *(() if quick else ((12, 25.0), (16, 25.0), (8, 1.0), (16, 1.0))))
    ]
    cases += [
        (f"Table 2, disc, {cells} × {cells // 2}", rectangle(1.0, 0.5, cells, cells // 2), 0.5, TABLE_2, disc)
        for cells in ((10,) if quick else (10, 20))
    ]
    models = {**DEFAULTS, "LocalDonnan": (LocalDonnan(), None)}
    found = []
    for case, mesh, height, material, motion in cases:
        error = partial(missed, references[motion], height)
        for name, choice in models.items():
            make = partial(on_base, mesh, *choice, material=material, kinematics=motion)
            found.append(attempt(case, f"{name}, equilibrate", make, 1.0, "rise", error, SEEN, Fixed(1.0), start=directly))
    if quick:
        return found
    error = partial(missed, references[plane], 1.0)
    for name, choice in DEFAULTS.items():
        make = partial(on_base, square(8, 25.0), *choice, charge=Ramp((0, 0.0), (1000, 1.0)))
        found.append(
            attempt("Table 1, 8 × 8, graded 25", f"{name}, raised", make, 1e5, "rise", error, SEEN, newton=ACCURATE)
        )
    return found


def released_body(cells: int, left: float, wet: str, model: Model, treatment: Treatment | None = None) -> Scene:
    """A quarter of a square of Table 1 that starts in equilibrium with its bath but for what of p0 is `left` outside."""
    return Scene(
        mesh=rectangle(1.0, 1.0, cells, cells),
        kinematics=PlaneStrain(),
        material=TABLE_1,
        model=model,
        supports=[Symmetry("bottom"), Symmetry("left")],
        baths=[Bath(wet, c=BATH, treatment=treatment)],
        loads=[Traction("top", (0.0, -left)), Traction("right", (-left, 0.0))],
    )


def settled(left: float) -> float:
    """J at rest under the traction `left` [N/mm²] per reference area: its pressure on the deformed surface is left/J^½."""
    J = 1.0
    for _ in range(60):
        J = homogeneous_equilibrium(TABLE_1, BATH, "plane strain", load=left / J**0.5).J
    return J


def soon(scene: Scene) -> Snapshot:
    """The state after a second: steps far shorter than what cells let drain."""
    return scene.run(1.0, Adaptive(1e-2)).end


def releases(quick: bool) -> list[Attempt]:
    """A load of 0.1 N/mm² taken off at once, on cells far wider than what the first steps let drain, by all treatments.

    The end is homogeneous, so every mesh holds it: J by its closed form, bound `AT_REST`.
    """
    found = []
    left = P0 - 0.1
    J = settled(left)
    for cells in (3,) if quick else (3, 4, 6):
        for wet in ("right",) if quick else ("right", "top|right"):
            for name, choice in (DEFAULTS if quick else CHOICES).items():
                make = partial(released_body, cells, left, wet, *choice)
                case = f"released, {cells} × {cells}, bath on {wet}"
                found.append(attempt(case, name, make, 1e6, "volume", off(J), AT_REST, newton=ACCURATE, start=soon))
    return found
