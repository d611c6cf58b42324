"""Bodies that the families share, homogeneous states of rest, and distances from closed forms.

The confined column of Table 1 under the load that holds its reference state, the same as a strip, and bodies of Table 2 that
swell freely.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from ngsolve import CF, Mesh, x, y
from numpy.typing import NDArray

from ngswell import TABLE_1, TABLE_2, Bath, DampedNewton, Material, Result, Scene, Spatial, Symmetry
from ngswell.baths.treatment import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.mesh.points import points, vertices
from ngswell.models.model import Model
from ngswell.schedules import Schedule
from ngswell.setup.snapshot import Snapshot
from studies.scenes import BATH, COLUMN_HEIGHT, confined_column, quarter_block, strip

Choice = tuple[Model, Treatment]

CELLS = 20
"""Of columns of h = 1/40 mm: h²/κ is 1.2 and 0.8 s for the two modes of Table 1."""

ACCURATE = DampedNewton()
"""Nonlinear solves to 1e-8, so that ledgers close to round-off and states of rest are as exact as their spaces."""

AT_REST = 1e-6
"""Bound on errors of homogeneous states, which lie in every discrete space: the solves' 1e-8 of the body's length, over
contents down to 1e-2."""


def column_scene(
    model: Model, treatment: Treatment, c: Any, cells: int, material: Material = TABLE_1, **changes: Any
) -> Scene:
    """The confined column under the bath `c`, from equilibrium with 0.15 mol/l."""
    parts = {"model": model, "material": material, "initial": (BATH, 0.0)}
    return confined_column(treatment, c, cells, **{**parts, **changes})


def strip_scene(model: Model, treatment: Treatment, c: Any, cells: int, **changes: Any) -> Scene:
    """The column as a strip of one cell across."""
    parts = {"model": model, "initial": (BATH, 0.0)}
    return strip(treatment, c, (1, cells), COLUMN_HEIGHT / cells, **{**parts, **changes})


def block_scene(model: Model, treatment: Treatment | None, c: Any, cells: int) -> Scene:
    """A quarter of a square of Table 2 that swells freely, from equilibrium with 1 mol/l."""
    return quarter_block(treatment, c, cells, material=TABLE_2, model=model, initial=(1.0, 0.0))


def free_body(
    mesh: Mesh,
    model: Model,
    treatment: Treatment,
    c: float | Schedule = 0.3,
    material: Material = TABLE_2,
    bath: str = "top|right",
) -> Scene:
    """A quarter of a body in plane strain, free but for its symmetry planes on the left and at the bottom."""
    baths = [Bath(bath, c=c, treatment=treatment)]
    return quarter_block(treatment, c, 1, mesh=mesh, material=material, model=model, baths=baths)


def solid_body(
    mesh: Mesh, model: Model, treatment: Treatment, c: float | Schedule = 0.3, material: Material = TABLE_2
) -> Scene:
    """An eighth of a block, x = 0, y = 0 and z = 0 being its symmetry planes."""
    return Scene(
        mesh=mesh,
        kinematics=Spatial(),
        material=material,
        model=model,
        supports=[Symmetry("left"), Symmetry("front"), Symmetry("bottom")],
        baths=[Bath("top|right|back", c=c, treatment=treatment)],
    )


# -- starts and errors ---------------------------------------------------------------------------------------------------


def at_rest(bath: float, motion: str, load: float, scene: Scene) -> Snapshot:
    """The homogeneous state of rest in `bath` [mol/l] by its closed form: it lies in every space."""
    rest = homogeneous_equilibrium(scene.material, bath, motion, load=load)
    problem = scene.problem
    problem.initialise()
    stretch = rest.J ** (1 / problem.mesh.dim)
    values = {"p": rest.p, "c": rest.c, "cfc": rest.cfc, "P": 0.0, "salt": bath}
    for name, field in zip(problem.model.unknowns, problem.fields.components, strict=False):
        field.Set((stretch - 1) * CF((x, y)[: problem.mesh.dim]) if name == "u" else values[name])
    return problem.snapshot(scene.start)


def distance(forms: Mapping[str, Callable[..., float]], count: int, scene: Scene, result: Result) -> float:
    """Largest relative distance of outputs from closed forms, functions of the place [mm], in some points of the body."""
    corners = vertices(scene.mesh)
    low, high = corners.min(axis=0), corners.max(axis=0)
    shares = (
        np.linspace(0.01, 0.99, count)[:, None]
        if scene.mesh.dim == 1
        else np.stack([np.linspace(0.99, 0.01, count)] * 2, axis=1)
    )
    places = low + shares * (high - low)
    outputs = result.state.outputs()
    found = [abs(outputs[name](scene.mesh(*at)) / form(*at) - 1) for name, form in forms.items() for at in places]
    return float(np.max(found))


def J_at_points(result: Result) -> NDArray:
    """J at integration points of all cells at the end of a run."""
    return result.state.J(points(result.setup.mesh, order=4)).ravel()


def off(J: float, least: float = 0.0) -> Callable[[Scene, Result], float]:
    """Largest |J − J₀| over J₀ − least: relative error of the volume, or of the fluid content with least = nS0."""
    return lambda scene, result: float(np.abs(J_at_points(result) - J).max() / (J - least))


def never(scene: Scene, result: Result) -> float:
    """The error of attempts that must not pass."""
    return np.inf


def directly(scene: Scene) -> Snapshot:
    """The start of attempts at states of rest by `equilibrate`; the one step after it must not leave them."""
    return scene.equilibrate()
