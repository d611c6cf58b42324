"""What is watched during a run. Each observer starts, observes accepted steps at the times it asks for, and finishes."""

from ngswell.observers.base import Observer
from ngswell.observers.checkpoint import Checkpoint
from ngswell.observers.coarseness import Coarseness
from ngswell.observers.ledger import Ledger
from ngswell.observers.progress import Progress
from ngswell.observers.sampling import Area, Integral, Probe, Snapshots
from ngswell.observers.stability import Stability
from ngswell.observers.vtk import VTK

__all__ = [
    "VTK",
    "Area",
    "Checkpoint",
    "Coarseness",
    "Integral",
    "Ledger",
    "Observer",
    "Probe",
    "Progress",
    "Snapshots",
    "Stability",
]
