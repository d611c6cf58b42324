"""Numbers that are each possible but hardly belong together: what their combination tells of their units."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from ngsolve import Mesh

from ngswell.calls import warn
from ngswell.errors import UnitsWarning
from ngswell.mesh.points import vertices
from ngswell.physics.material import Material
from ngswell.team import Team

SHORTEST = 1e-2
"""Time [s] within which no body is at rest again: a gel bead 10 µm across, with half that to the bath, takes some 0.05 s."""

WEAKEST = 1e-4
"""Rθ cfc0 over 2µ + λ: the charge swells the body by less. Gels and cartilage have 0.1 to 100, clays 1e-3."""

RATIOS = 1e-6, 1e4
"""(2µ + λ) K/D: gels, cartilage and clays lie between 1e-3 and 1e3, as narrow pores hinder fluid and salt alike."""


def check_units(mesh: Mesh, material: Material, team: Team) -> None:
    """Warn, once for the team, with UnitsWarning of a body whose numbers hardly belong together.

    What is compared: the times L²/[K (2µ + λ)] and L²/D in which fluid and salt pass the largest extent L; the one over the
    other; the pressure Rθ cfc0 over 2µ + λ. Without ions only the first is left.
    """
    if doubts := list(_doubts(mesh, material)):
        warn(UnitsWarning(" Besides, ".join(doubts)), team)


def _doubts(mesh: Mesh, material: Material) -> Iterator[str]:
    size = float(np.ptp(vertices(mesh), axis=0).max())
    mu, lam, K = (material.largest(name, mesh) for name in ("mu", "lam", "K"))
    stiffness = 2 * mu + lam
    fluid, salt = size**2 / (K * stiffness), 0.0
    numbers = f"2µ + λ = {stiffness:.3g} N/mm², K = {K:.3g} mm⁴/(N s)"
    times = f"fluid passes it within L²/[K (2µ + λ)] = {fluid:.2g} s"
    if material.D_plus is not None:
        D = material.largest("D_plus", mesh)
        salt = size**2 / D
        numbers += f", D₊ = {D:.3g} mm²/s"
        times += f", salt within L²/D₊ = {salt:.2g} s"
        if not RATIOS[0] <= salt / fluid <= RATIOS[1]:
            yield (
                f"the body has {numbers}: {times}, {salt / fluid:.1g} times as long; pores that let both pass have about 1. "
                "Are µ and λ in MPa = N/mm² (1 Pa = 1e-6), K in mm⁴/(N s) (1 m⁴/(N s) = 1e12), and D in mm²/s?"
            )
    if max(fluid, salt) < SHORTEST:
        yield (
            f"the body is {size:.3g} mm = {1e3 * size:.3g} µm large: {times}. Is it in metres? 1 m = 1000 mm, "
            "`5 * ngswell.metre`"
        )
    pressure = material.RT * material.largest("cfc0", mesh)
    if 0 < pressure < WEAKEST * stiffness:
        yield (
            f"the charge presses with Rθ cfc0 = {pressure:.2g} N/mm² on a solid of 2µ + λ = {stiffness:.3g} N/mm²: it "
            f"swells by some {pressure / stiffness:.1g}. Are µ and λ in MPa = N/mm² (1 Pa = 1e-6), and is cfc0 in mol/l?"
        )
