"""Swelling of charged hydrated porous media on NGSolve. Units mm, N, s, K, mol/l."""

from __future__ import annotations

from ngswell.baths.bath import Bath, Essential, Frozen, Lagged, Multiplier, Nitsche, Penalty
from ngswell.baths.sampling import Averaged, InnerLayer, LeastSquares
from ngswell.errors import InputError, InstabilityError, NgswellError, OutputError, StepError
from ngswell.mesh.gmsh import read_mesh
from ngswell.mesh.shapes import box, check_mesh, column, from_occ, rectangle
from ngswell.models.concentration import Concentration
from ngswell.models.local_donnan import LocalDonnan
from ngswell.models.potential import Potential
from ngswell.models.uncharged import Uncharged
from ngswell.observers.coarseness import Coarseness
from ngswell.observers.ledger import Ledger
from ngswell.observers.progress import Progress
from ngswell.observers.sampling import Area, Integral, Probe, Snapshots
from ngswell.observers.stability import Stability
from ngswell.observers.vtk import VTK
from ngswell.physics.kinematics import Axisymmetric, Confined, PlaneStrain, Solid
from ngswell.physics.material import TABLE_1, TABLE_2, HolmesMow, MackieMeares, Material, PowerLaw
from ngswell.run.checkpoint import Checkpoint
from ngswell.run.restart import Restart, read_checkpoint
from ngswell.scene import Result, Scene
from ngswell.schedules import Blend, Ramp
from ngswell.setup.supports import Pin, Roller, Symmetry, Traction, Weight
from ngswell.solve.newton import Newton
from ngswell.solve.two_level import TwoLevelSolver
from ngswell.stepping.schemes import BACKWARD_EULER, ESDIRK4
from ngswell.stepping.stepper import Adaptive, Fixed

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
