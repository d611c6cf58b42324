"""What tells one setup from another, in every process: digests of its parts."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from hashlib import sha256
from typing import Any

import numpy as np
from ngsolve import CF, VOL, CoefficientFunction
from numpy.typing import NDArray

from ngswell.mesh.points import points
from ngswell.physics.material import Material
from ngswell.physics.solid import nominal_stress
from ngswell.setup.setup import Setup

_PARTS = ("kinematics", "material", "model", "supports", "loads", "charge", "start", "initial")

_SAMPLES = ((0.8, 0.0), (1.5, 0.3), (3.0, -0.5))
"""Stretches and shears at which solid laws are compared."""


def setup_digest(setup: Setup) -> dict[str, str]:
    """A digest of each part. Fields of position count by their values at quadrature points, to six digits."""
    mesh = setup.mesh
    inside = points(mesh, VOL, 4)
    texts = {name: canonical_text(getattr(setup, name), inside) for name in _PARTS}
    texts["mesh"] = setup.mesh_digest
    texts["material"] += repr(setup.material.samples) + _solid_samples(setup.material, inside)
    texts["baths"] = repr(
        [
            # the points on the boundary are none in 1-d
            [canonical_text(bath, inside), canonical_text(bath, points(mesh, mesh.Boundaries(bath.boundary), 4))]
            for bath in setup.baths
        ]
    )
    origin = setup.origin
    texts["origin"] = repr(origin and (origin.time, sha256(np.ascontiguousarray(origin.values).tobytes()).hexdigest()))
    return {name: sha256(text.encode()).hexdigest() for name, text in texts.items()}


def _solid_samples(material: Material, where: NDArray) -> str:
    """Stresses of the solid law, which tell two laws of one name apart. Where they are uniform, cells do not count."""
    gradients = [CF((s, t, 0, 0, 1, 0, 0, 0, 1 / s**0.5), dims=(3, 3)) for s, t in _SAMPLES]
    stresses = [nominal_stress(F, material)(where).astype(np.float32) for F in gradients]
    return "".join(digest_of_numbers(s[:1] if (s == s[0]).all() else s) for s in stresses)


def canonical_text(value: Any, where: NDArray | None = None) -> str:
    """A description that is the same in every process; of a function its name only."""
    if isinstance(value, CoefficientFunction):
        return type(value).__name__ if where is None else digest_of_numbers(value(where))
    if isinstance(value, (bool, str, type(None))):
        return repr(value)
    if isinstance(value, (int, float, np.integer, np.floating)):
        return repr(float(value))
    if isinstance(value, (tuple, list)):
        return f"({', '.join(canonical_text(entry, where) for entry in value)})"
    if callable(value) and hasattr(value, "__qualname__"):
        return f"{value.__module__}.{value.__qualname__}"
    named = (
        {f.name: getattr(value, f.name) for f in fields(value)} if is_dataclass(value) else getattr(value, "__dict__", {})
    )
    return f"{type(value).__qualname__}({', '.join(f'{k}={canonical_text(v, where)}' for k, v in named.items())})"


def digest_of_numbers(values: NDArray) -> str:
    """In single precision: processors differ in the last digits of a double."""
    return sha256(np.ascontiguousarray(values, dtype=np.float32).tobytes()).hexdigest()
