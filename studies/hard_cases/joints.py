"""Meshes whose cells touch without sharing sides, or change under a scene; baths that press."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import netgen.meshing as netgen
import numpy as np
from ngsolve import Mesh

from ngswell import TABLE_1, TABLE_2, Bath, Fixed, Result, Scene, box, column, rectangle
from ngswell.baths.treatment import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.models.model import Model
from studies.hard_cases.attempt import DEFAULTS, Attempt, attempt
from studies.hard_cases.bodies import AT_REST, directly, free_body, never, off, solid_body
from studies.scenes import confined_column

Place = tuple[float, float]

PRESSURE = 0.25
"""Of baths [N/mm²]; about the shear modulus of Table 1."""


def rows(low: Place, high: Place, cells: int) -> list[list[Place]]:
    """A rectangle from one corner to the other in rows of one quadrilateral each."""
    ys = np.linspace(low[1], high[1], cells + 1).tolist()
    return [[(low[0], a), (high[0], a), (high[0], b), (low[0], b)] for a, b in pairwise(ys)]


def joined(*bodies: list[list[Place]], apart: Sequence[Place] = ()) -> Mesh:
    """Bodies of quadrilaterals as one mesh, sides named as in `rectangle`. Vertices at places `apart` stay their own."""
    names: dict[tuple, int] = {}
    cells = [
        [names.setdefault((corner, body if corner in apart else -1), len(names)) for corner in cell]
        for body, cells in enumerate(bodies)
        for cell in cells
    ]
    places = np.array([corner for corner, _ in names])
    mesh = netgen.Mesh(dim=2)
    mesh.AddPoints(np.column_stack([places, np.zeros(len(places))]))
    mesh.AddElements(dim=2, index=mesh.AddRegion("body", dim=2), data=np.array(cells, dtype=np.int32), base=0)
    for name, axis, end in (("bottom", 1, min), ("right", 0, max), ("top", 1, max), ("left", 0, min)):
        edges = [(cell[i], cell[(i + 1) % 4]) for cell in cells for i in range(4)]
        on = [edge for edge in edges if all(places[number, axis] == end(places[:, axis]) for number in edge)]
        mesh.AddElements(dim=1, index=mesh.AddRegion(name, dim=1), data=np.array(on, dtype=np.int32), base=0)
    return Mesh(mesh)


def refined_under(model: Model, treatment: Treatment) -> Scene:
    """A scene whose mesh is refined after it was made."""
    mesh = rectangle(1.0, 1.0, 2, 2, triangles=True)
    scene = free_body(mesh, model, treatment)
    mesh.Refine()
    return scene


ONE, TWO = rows((0.0, 0.0), (1.0, 1.0), 1), rows((0.0, 0.0), (1.0, 1.0), 2)
BESIDE = rows((1.0, 0.0), (2.0, 1.0), 2)

UNSOUND: dict[str, Callable[[Model, Treatment], Scene]] = {
    "hanging node": lambda m, t: free_body(joined(ONE, BESIDE), m, t),
    "two vertices between shared ends": lambda m, t: free_body(joined(TWO, BESIDE, apart=[(1.0, 0.5)]), m, t),
    "sides of duplicates": lambda m, t: free_body(joined(TWO, BESIDE, apart=[(1.0, 0.0), (1.0, 0.5), (1.0, 1.0)]), m, t),
    "hinge": lambda m, t: free_body(joined(ONE, rows((1.0, 1.0), (2.0, 2.0), 1)), m, t),
    "refined under the scene": refined_under,
}
"""Meshes that have to be refused."""

IMMERSED: dict[str, tuple[str, Callable[[Model, Treatment], Scene]]] = {
    "joined": ("plane strain", lambda m, t: free_body(joined(TWO, BESIDE), m, t)),
    "square": ("plane strain", lambda m, t: free_body(rectangle(1.0, 1.0, 2, 2), m, t)),
    "cube": ("3-d", lambda m, t: solid_body(box(1.0, 1.0, 1.0, 1, 1, 1), m, t)),
}
"""Bodies of Table 2 in a bath all around, with the motion of their closed form."""


def pressed(make: Callable[[Model, Treatment], Scene], model: Model, treatment: Treatment) -> Scene:
    """The same scene with its baths at `PRESSURE`."""
    scene = make(model, treatment)
    return replace(scene, baths=[replace(bath, P=PRESSURE) for bath in scene.baths])


def plug(plate: bool, model: Model, treatment: Treatment) -> Scene:
    """An uncharged column on a filter: fluid at `PRESSURE` on top, which a porous `plate` may carry, none at the bottom."""
    baths = [
        Bath("top", c=0.15, P=PRESSURE, treatment=treatment, porous_plate=plate),
        Bath("bottom", c=0.15, treatment=treatment),
    ]
    parts = {"mesh": column(1.0, 20), "material": replace(TABLE_1, cfc0=0.0), "loads": [], "initial": (0.15, 0.0)}
    return confined_column(treatment, 0.15, 20, model=model, baths=baths, **parts)


def plug_error(plate: bool, scene: Scene, result: Result) -> float:
    """Error of the top's displacement [mm] over the exact one.

    The flux K/J dp/dX is uniform and the solid bears σ = p − P̄, or p where a plate carries P̄: dX ∝ dσ/J(σ).
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)
    stresses = PRESSURE * (nodes + 1) / 2 - (0.0 if plate else PRESSURE)
    J = np.array([homogeneous_equilibrium(scene.material, 1.0, "confined", load=-s).J for s in stresses])
    exact = float(weights @ (1 - 1 / J) / (weights @ (1 / J)))
    return abs(float(result.state.at((1.0,), "displacement")) / exact - 1)


def joints(quick: bool) -> list[Attempt]:
    """Cells that touch without sharing sides, hinges and meshes that change have to be refused; the body joined passes.

    Under a bath's pressure all around homogeneous states are those without it: bound `AT_REST`. A permeated plug, held at
    its filter, meets its quadrature: u of order 2 and p of order 1 on 20 cells leave 2e-4 (second order), bound 5e-4.
    """
    found = []
    for name, choice in DEFAULTS.items():
        for case, make in UNSOUND.items():
            found.append(attempt(case, name, partial(make, *choice), 1.0, "accepting it is wrong", never, 0.0, Fixed(1.0)))
        for case, (motion, make) in IMMERSED.items():
            error = off(homogeneous_equilibrium(TABLE_2, 0.3, motion).J)
            for variant, body in (("", partial(make, *choice)), (", pressed", partial(pressed, make, *choice))):
                found.append(attempt(case + variant, name, body, 1.0, "volume", error, AT_REST, Fixed(1.0), start=directly))
        for case, plate in (("permeated plug", False), ("permeated plug under a plate", True)):
            body, error = partial(plug, plate, *choice), partial(plug_error, plate)
            found.append(attempt(case, name, body, 1e3, "displacement", error, 5e-4, Fixed(1e3), start=directly))
    return found
