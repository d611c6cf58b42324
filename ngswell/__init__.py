"""Swelling of charged hydrated porous media on NGSolve. Units mm, N, s, K, mol/l."""

from __future__ import annotations

import os

for _variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # BLAS threads fight NGSolve's TaskManager
    os.environ.setdefault(_variable, "1")

from ngswell.baths import Bath, Frozen, Lagged, Penalty  # noqa: E402
from ngswell.errors import InputError, NgswellError, OutputError, StepError  # noqa: E402
from ngswell.kinematics import Confined, PlaneStrain  # noqa: E402
from ngswell.materials import TABLE_1, TABLE_2, Material  # noqa: E402
from ngswell.meshes import column, rectangle  # noqa: E402
from ngswell.models import Concentration  # noqa: E402
from ngswell.newton import Newton  # noqa: E402
from ngswell.observers import VTK, Area, Integral, Ledger, Probe, Progress, Snapshots  # noqa: E402
from ngswell.scene import Result, Scene  # noqa: E402
from ngswell.schedules import Blend, Ramp  # noqa: E402
from ngswell.stepping import Adaptive, Fixed  # noqa: E402
from ngswell.supports import Pin, Roller, Symmetry, Traction, Weight  # noqa: E402

__version__ = "0.1.0"

__all__ = [
    "TABLE_1", "TABLE_2", "VTK", "Adaptive", "Area", "Bath", "Blend", "Concentration", "Confined", "Fixed", "Frozen",
    "InputError", "Integral", "Lagged", "Ledger", "Material", "Newton", "NgswellError", "OutputError", "Penalty", "Pin",
    "PlaneStrain", "Probe", "Progress", "Ramp", "Result", "Roller", "Scene", "Snapshots", "StepError", "Symmetry",
    "Traction", "Weight", "column", "rectangle",
]  # fmt: skip
