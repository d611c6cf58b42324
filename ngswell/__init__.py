"""Swelling of charged hydrated porous media on NGSolve. Units mm, N, s, K, mol/l."""

from __future__ import annotations

from ngswell.baths import Bath, Essential, Frozen, Lagged, Multiplier, Nitsche, Penalty
from ngswell.errors import InputError, InstabilityError, NgswellError, OutputError, StepError
from ngswell.gmsh import read_mesh
from ngswell.kinematics import Axisymmetric, Confined, PlaneStrain, Solid
from ngswell.krylov import TwoLevelSolver
from ngswell.materials import TABLE_1, TABLE_2, HolmesMow, MackieMeares, Material, PowerLaw
from ngswell.meshes import box, check_mesh, column, from_occ, rectangle
from ngswell.models import Concentration, LocalDonnan, Potential, Uncharged
from ngswell.newton import Newton
from ngswell.observers import VTK, Area, Checkpoint, Coarseness, Integral, Ledger, Probe, Progress, Snapshots, Stability
from ngswell.restart import Restart, read_checkpoint
from ngswell.sampling_rules import Averaged, InnerLayer, LeastSquares
from ngswell.scene import Result, Scene
from ngswell.schedules import Blend, Ramp
from ngswell.schemes import BACKWARD_EULER, ESDIRK4
from ngswell.stepping import Adaptive, Fixed
from ngswell.supports import Pin, Roller, Symmetry, Traction, Weight

__version__ = "0.1.0"

__all__ = [
    "BACKWARD_EULER", "ESDIRK4", "TABLE_1", "TABLE_2", "VTK", "Adaptive", "Area", "Averaged", "Axisymmetric", "Bath",
    "Blend", "Checkpoint", "Coarseness", "Concentration", "Confined", "Essential", "Fixed", "Frozen", "HolmesMow",
    "InnerLayer", "InputError", "InstabilityError", "Integral", "Lagged", "LeastSquares", "Ledger", "LocalDonnan",
    "MackieMeares", "Material", "Multiplier", "Newton", "NgswellError", "Nitsche", "OutputError", "Penalty", "Pin",
    "PlaneStrain", "Potential", "PowerLaw", "Probe", "Progress", "Ramp", "Restart", "Result", "Roller", "Scene",
    "Snapshots", "Solid", "Stability", "StepError", "Symmetry", "Traction", "TwoLevelSolver", "Uncharged", "Weight",
    "box", "check_mesh", "column", "from_occ", "read_checkpoint", "read_mesh", "rectangle",
]  # fmt: skip
