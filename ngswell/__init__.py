"""Swelling of charged hydrated porous media on NGSolve. Units mm, N, s, K, mol/l.

Folders, each importing only from those above it: units, errors, meeting, team, calls, checks, files, streams, schedules,
histories · mesh · physics · models · baths · setup · problem · solve · stepping · analysis · observers · run · scene. Beside
them stand closed_forms and plotting.
"""

from __future__ import annotations

import inspect
from enum import Enum

from ngswell.baths.bath import Bath
from ngswell.baths.lagged import Averaged, InnerLayer, Lagged, LeastSquares
from ngswell.baths.multiplier import Multiplier
from ngswell.baths.nitsche import Nitsche
from ngswell.baths.penalty import Penalty
from ngswell.baths.prescribed import Essential, Frozen
from ngswell.baths.treatment import Prescribed, Weak
from ngswell.baths.vessel import Vessel
from ngswell.calls import refusing
from ngswell.errors import (
    CompilerWarning,
    ExtrapolationWarning,
    InputError,
    InstabilityError,
    InstabilityWarning,
    NgswellError,
    OutputError,
    OverlapWarning,
    Reason,
    StepError,
    UnitsWarning,
)
from ngswell.histories import Sine, Spline
from ngswell.mesh.gmsh import read_mesh
from ngswell.mesh.shapes import box, column, from_occ, ray, rectangle
from ngswell.mesh.soundness import check_mesh
from ngswell.models.concentration import Concentration
from ngswell.models.local_donnan import LocalDonnan
from ngswell.models.potential import Potential
from ngswell.models.term import Role, Term
from ngswell.models.uncharged import Uncharged
from ngswell.observers.base import Observer
from ngswell.observers.call import Call
from ngswell.observers.coarseness import Coarseness
from ngswell.observers.ledger import Ledger
from ngswell.observers.outflow import Outflow
from ngswell.observers.progress import Progress
from ngswell.observers.reaction import Reaction
from ngswell.observers.sampling import Area, Integral, Probe, Snapshots
from ngswell.observers.stability import Stability
from ngswell.observers.vtk import VTK
from ngswell.physics.anisotropy import Orthotropic, TransverselyIsotropic
from ngswell.physics.elastic import HolmesMowSolid, LogNeoHookean, MooneyRivlin
from ngswell.physics.fibres import FibreDistribution, FibreReinforced, Fibres
from ngswell.physics.kinematics import Axisymmetric, Confined, PlaneStrain, Spatial
from ngswell.physics.material import TABLE_1, TABLE_2, Material
from ngswell.physics.pores import HolmesMow, MackieMeares, PowerLaw
from ngswell.physics.radial import Cylindrical, Spherical
from ngswell.physics.regions import by_region
from ngswell.physics.solid import NeoHookean
from ngswell.problem.problem import Problem
from ngswell.run.checkpoint import Checkpoint
from ngswell.run.restart import Restart, read_checkpoint
from ngswell.run.result import Result
from ngswell.scene import Scene
from ngswell.schedules import Blend, Ramp
from ngswell.setup.efflux import Efflux
from ngswell.setup.loads import Load, Pressure, Traction, Weight
from ngswell.setup.obstacles import Obstacle
from ngswell.setup.platen import Platen
from ngswell.setup.rigid import RigidCylinder, RigidPlane, RigidSphere
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.setup.supports import Pin, Roller, Support, Symmetry
from ngswell.solve.newton import DampedNewton
from ngswell.solve.petsc import PETScSolver
from ngswell.solve.two_level import TwoLevelSolver
from ngswell.stepping.schemes import BACKWARD_EULER, ESDIRK4
from ngswell.stepping.steps import Adaptive, Fixed
from ngswell.streams import CSV
from ngswell.units import MPa, day, hour, kPa, metre, micrometre, year
from ngswell.version import __version__ as __version__

__all__ = [
    "BACKWARD_EULER", "CSV", "ESDIRK4", "TABLE_1", "TABLE_2", "VTK", "Adaptive", "Area", "Averaged", "Axisymmetric",
    "Bath", "Blend", "Call", "Checkpoint", "Coarseness", "CompilerWarning", "Concentration", "Confined", "Cylindrical",
    "DampedNewton", "Efflux", "Essential", "ExtrapolationWarning", "FibreDistribution", "FibreReinforced", "Fibres",
    "Fixed", "Frozen", "HolmesMow", "HolmesMowSolid", "InnerLayer", "InputError", "InstabilityError",
    "InstabilityWarning", "Integral", "Lagged", "LeastSquares", "Ledger", "Load", "LocalDonnan", "LogNeoHookean", "MPa",
    "MackieMeares", "Material", "MooneyRivlin", "Multiplier", "NeoHookean", "NgswellError", "Nitsche", "Observer",
    "Obstacle", "Orthotropic", "Outflow", "OutputError", "OverlapWarning", "PETScSolver", "Penalty", "Pin", "PlaneStrain",
    "Platen", "Potential", "PowerLaw", "Prescribed", "Pressure", "Probe", "Problem", "Progress", "Ramp", "Reaction",
    "Reason", "Restart", "Result", "RigidCylinder", "RigidPlane", "RigidSphere", "Role", "Roller", "Scene", "Setup", "Sine",
    "Snapshot", "Snapshots", "Spatial", "Spherical", "Spline", "Stability", "StepError", "Support", "Symmetry", "Term",
    "Traction", "TransverselyIsotropic", "TwoLevelSolver", "Uncharged", "UnitsWarning", "Vessel", "Weak", "Weight",
    "box", "by_region", "check_mesh", "column", "day", "from_occ", "hour", "kPa", "metre", "micrometre", "ray",
    "read_checkpoint", "read_mesh", "rectangle", "year",
]  # fmt: skip

for _name in __all__:
    if inspect.isroutine(_thing := globals()[_name]) or (
        inspect.isclass(_thing) and not issubclass(_thing, (Exception, Enum))
    ):
        globals()[_name] = refusing(_thing)
