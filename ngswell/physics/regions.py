"""Parameters and materials that differ from region to region of a mesh."""

from __future__ import annotations

from dataclasses import fields
from difflib import get_close_matches
from typing import Any

from ngsolve import CF, CoefficientFunction, Mesh

from ngswell import checks
from ngswell.errors import InputError
from ngswell.physics.material import LAWS, Material
from ngswell.physics.ranges import ONE_NUMBER


def by_region(mesh: Mesh, /, **values: Any) -> Any:
    """One value for each region of `mesh`, `by_region(mesh, core=0.12, skin=1.2)`, all numbers or all materials.

    Of numbers, in the parameter's unit, a field of position for any parameter of `Material` that may be one. Of materials,
    a `Material` whose parameters differ from region to region; its laws and what has to be one number have to agree.
    Regions whose names are no words of Python: `**{"region 1": 0.12}`. Raises InputError for a region that the mesh does
    not have or that is left out, for values of other kinds, and for materials that cannot share a body.
    """
    checks.instance(
        "by_region: mesh", mesh, Mesh, "a mesh of NGSolve, as column, rectangle, box, from_occ and read_mesh make"
    )
    known = list(dict.fromkeys(mesh.GetMaterials()))
    for name in values:
        if name not in known:
            meant = get_close_matches(name, known, 1)
            maybe = f"; {meant[0]!r} may be meant" if meant else ""
            raise InputError(f"by_region: the mesh has no region {name!r}; it has {', '.join(map(repr, known))}{maybe}")
    missing = [name for name in known if name not in values]
    if missing:
        every = ", ".join(map(repr, known))
        raise InputError(f"by_region: {', '.join(map(repr, missing))} has no value; give one for every region: {every}")
    if all(checks.is_a(value, Material) for value in values.values()):
        return _material(mesh, values)
    return _field(mesh, {name: checks.number(f"by_region: {name}", value) for name, value in values.items()})


def _field(mesh: Mesh, values: dict[str, Any]) -> CoefficientFunction:
    """The field that has these values; it keeps the names by which a scene tells whether its mesh is meant."""
    field = CF([values[name] for name in mesh.GetMaterials()])
    field.regions = mesh.GetMaterials()
    return field


def _material(mesh: Mesh, materials: dict[str, Material]) -> Material:
    given = {}
    for parameter in fields(Material):
        name = parameter.name
        values = {region: getattr(material, name) for region, material in materials.items()}
        (first, value), *others = values.items()
        other = next((region for region, another in others if another is not value and another != value), None)
        if other is not None and name in (*LAWS, *ONE_NUMBER):
            raise InputError(
                f"by_region: {name} is {checks.short(value)} in {first!r} but {checks.short(values[other])} in {other!r}; "
                "it has to be the same in every region"
            )
        without = [region for region, another in values.items() if another is None]
        if without and len(without) < len(values):
            raise InputError(
                f"by_region: {name} is missing in {', '.join(map(repr, without))}; give every region's material its ions, "
                "cfc0 = 0.0 where there is no charge"
            )
        given[name] = value if other is None else _field(mesh, values)
    return Material(**given)
