"""The parts of a mesh that are not connected with each other."""

from __future__ import annotations

import numpy as np
from ngsolve import Mesh
from numpy.typing import NDArray

from ngswell.errors import InputError, place


def connected_parts(mesh: Mesh) -> list[NDArray]:
    """Numbers of the vertices of each part of a mesh that edges connect."""
    ends = np.array([[vertex.nr for vertex in edge.vertices] for edge in mesh.edges])
    label = np.arange(mesh.nv)
    while True:
        least = label[ends].min(axis=1)
        if (label[ends] == least[:, None]).all():
            return [np.flatnonzero(label == number) for number in np.unique(label)]
        for side in ends.T:
            np.minimum.at(label, side, least)
        label = label[label]


def check_separate(places: NDArray, parts: list[NDArray]) -> None:
    """Refuse parts that touch without sharing vertices: they would not know of each other."""
    if len(parts) == 1:
        return
    size = float(np.ptp(places, axis=0).max())
    seen: dict[tuple[int, ...], int] = {}
    for index, part in enumerate(parts):
        for number in part:
            key = tuple(np.round(places[number] / (1e-9 * size)).astype(int).tolist())
            if seen.setdefault(key, index) != index:
                raise InputError(
                    f"mesh: two parts that are not connected touch near {place(places[number])} mm: merge their vertices "
                    "(Glue in netgen.occ, Coherence in Gmsh)"
                )
