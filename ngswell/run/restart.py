"""All that the rest of a run depends on, in a file and back."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ngsolve
import numpy as np
from ngsolve import BND, CF, VOL, CoefficientFunction, x, y, z
from numpy.typing import NDArray

import ngswell
from ngswell.errors import InputError
from ngswell.files import replacing
from ngswell.mesh.points import points, vertices
from ngswell.problem.problem import Snapshot
from ngswell.stepping.stepper import StepReport

if TYPE_CHECKING:
    from ngswell.observers.base import Observer
    from ngswell.scene import Scene

FORMAT = 1
"""Number of the file format: what an entry is called and means."""

Memory = dict[str, NDArray]


@dataclass(frozen=True)
class Restart:
    """A run after one of its steps, for `scene.run(..., resume=...)`.

    `snapshot` is the state; `begin` [s] where the run began; `steps` and `seconds` its work so far; `stepper` and
    `observers` (by name and settings) what these remember. `method` and `parts` say which steps and which scene it belongs
    to, `versions` what computed it, `file` where it was read.
    """

    snapshot: Snapshot
    begin: float
    steps: tuple[StepReport, ...]
    seconds: float
    stepper: Memory
    observers: tuple[tuple[str, Memory], ...]
    method: str
    parts: dict[str, str]
    versions: str
    file: Path | None = None

    def check(self, scene: Scene, observers: Sequence[Observer]) -> None:
        """Refuse to go on with another scene, other versions or other observers."""
        at, afresh = f"resume: {self.file}", "resume=restart.snapshot goes on from its state alone, with new observers"
        differ = [name for name, digest in parts(scene).items() if self.parts.get(name) != digest]
        if differ:
            raise InputError(f"{at} is of another scene: {', '.join(differ)} differ; run the scene it was written by")
        if self.versions != versions():
            raise InputError(f"{at} was written by {self.versions}, this is {versions()}: take those versions; {afresh}")
        known, present = [name for name, _ in self.observers], [repr(o) for o in observers if o.remembers]
        if known != present:
            listed = [", ".join(names) or "none" for names in (known, present)]
            raise InputError(f"{at} has the observers {listed[0]}, this run {listed[1]}: take the same ones; {afresh}")

    def write(self, path: Path) -> None:
        """Write `path`, whole or not at all; raises OutputError."""
        said = {
            "format": FORMAT, "versions": self.versions, "begin": self.begin, "time": self.snapshot.time,
            "seconds": self.seconds, "method": self.method, "parts": self.parts,
            "observers": [name for name, _ in self.observers], "steps": [astuple(step) for step in self.steps],
        }  # fmt: skip
        arrays = {"fields": self.snapshot.values}
        arrays |= {f"stepper/{key}": value for key, value in self.stepper.items()}
        for number, (_, memory) in enumerate(self.observers):
            arrays |= {f"observer {number}/{key}": value for key, value in memory.items()}
        arrays["ngswell"] = np.array(json.dumps({**said, "entries": list(arrays)}).encode())
        with replacing(path, "Checkpoint") as new, open(new, "wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]


def read_checkpoint(path: str | Path) -> Restart:
    """What a `Checkpoint` wrote to `path`. Raises InputError for a file that is none, or is damaged."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; start without resume, or name the checkpoint")
    remedy = "resume from a copy of it, or start again without resume"
    try:
        with zipfile.ZipFile(path) as archive:
            damaged = archive.testzip()
        if damaged is not None:
            raise ValueError(f"checksum of {damaged}")
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        said = json.loads(arrays.pop("ngswell").item()) if "ngswell" in arrays else None
        if said is None or said["format"] == FORMAT:
            return _restart(said, arrays, path)
    except Exception as error:  # whatever damaged bytes make zipfile, numpy and json raise
        raise InputError(f"{path} is no checkpoint, or is cut short or damaged ({error}); {remedy}") from error
    raise InputError(
        f"{path} has the checkpoint format {said['format']} ({said.get('versions')}), this ngswell reads format {FORMAT}; "
        "go on with the version that wrote it, or start again without resume"
    )


def _restart(said: dict[str, Any] | None, arrays: Memory, path: Path) -> Restart:
    if said is None:
        raise ValueError("nothing in it is called ngswell")
    if list(arrays) != said["entries"]:
        raise ValueError("entries are missing")

    def below(prefix: str) -> Memory:
        return {name.removeprefix(prefix): value for name, value in arrays.items() if name.startswith(prefix)}

    return Restart(
        Snapshot(said["time"], arrays["fields"]),
        said["begin"],
        tuple(StepReport(time, dt, count, tuple(why), error) for time, dt, count, why, error in said["steps"]),
        said["seconds"],
        below("stepper/"),
        tuple((name, below(f"observer {number}/")) for number, name in enumerate(said["observers"])),
        said["method"],
        said["parts"],
        said["versions"],
        path,
    )


def versions() -> str:
    """What computes here; another NGSolve may number unknowns differently."""
    return f"ngswell {ngswell.__version__} on NGSolve {ngsolve.__version__}"


def parts(scene: Scene) -> dict[str, str]:
    """A digest of each part of a scene. Fields of position count by their values at quadrature points, to six digits."""
    mesh = scene.mesh
    places, inside = vertices(mesh), points(mesh, VOL, 4)
    cells = [(e.mat, [v.nr for v in e.vertices]) for region in (VOL, BND) for e in mesh.Elements(region)]
    shape = _numbers(CF((x, y, z)[: mesh.dim])(inside))
    laws = [
        [float(scene.material.permeability(1.0, J, 0.25)) for J in np.linspace(0.5, 4.0, 29)],
        [float(scene.material.diffusivity(1.0, nF)) for nF in np.linspace(0.05, 0.95, 19)],
    ]
    texts = {name: text_of(getattr(scene, name), inside) for name in _PARTS}
    texts["mesh"] = repr((places.tolist(), cells, shape))
    texts["material"] += repr(laws)
    texts["baths"] = repr(
        [
            [text_of(bath, inside), text_of(bath, points(mesh, mesh.Boundaries(bath.boundary), 4))]  # the latter none in 1-d
            for bath in scene.baths
        ]
    )
    return {name: sha256(text.encode()).hexdigest() for name, text in texts.items()}


_PARTS = ("kinematics", "material", "model", "supports", "loads", "charge", "start", "initial")


def text_of(value: Any, where: NDArray | None = None) -> str:
    """A description that is the same in every process; of a function its name only."""
    if isinstance(value, CoefficientFunction):
        return type(value).__name__ if where is None else _numbers(value(where))
    if isinstance(value, (bool, str, type(None))):
        return repr(value)
    if isinstance(value, (int, float, np.integer, np.floating)):
        return repr(float(value))
    if isinstance(value, (tuple, list)):
        return f"({', '.join(text_of(entry, where) for entry in value)})"
    if callable(value) and hasattr(value, "__qualname__"):
        return f"{value.__module__}.{value.__qualname__}"
    named = (
        {f.name: getattr(value, f.name) for f in fields(value)} if is_dataclass(value) else getattr(value, "__dict__", {})
    )
    return f"{type(value).__qualname__}({', '.join(f'{k}={text_of(v, where)}' for k, v in named.items())})"


def _numbers(values: NDArray) -> str:
    """Single precision: processors differ in the last digits of a double."""
    return sha256(np.ascontiguousarray(values, dtype=np.float32).tobytes()).hexdigest()
