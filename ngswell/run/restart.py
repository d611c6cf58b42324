"""All that the rest of a run depends on, in a file and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ngsolve

from ngswell import checks
from ngswell.errors import InputError
from ngswell.files import Tree, read_tree, write_tree
from ngswell.observers.base import Observer
from ngswell.run.digest import setup_digest
from ngswell.run.log import as_list, from_list
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.steps import StepReport
from ngswell.version import __version__

FORMAT = 4
"""Number of the file format: what an entry is called and means."""


@dataclass(frozen=True)
class Restart:
    """A run after one of its steps, for `scene.run(..., resume=...)`.

    `snapshot` is the state; `begin` [s] where the run began; `steps` and `seconds` its work so far, `log` where its steps
    stand in a file; `stepper` and `observers` (by name and settings) what these remember. `method` and `digest` say which
    steps and which setup it belongs to, `versions` what computed it, `file` where it was read.
    """

    snapshot: Snapshot
    begin: float
    steps: tuple[StepReport, ...]
    log: Tree
    seconds: float
    stepper: Tree
    observers: tuple[tuple[str, Tree], ...]
    method: str
    digest: dict[str, str]
    versions: str
    file: Path | None = None

    def check(self, setup: Setup, observers: Sequence[Observer]) -> None:
        """Refuse to go on with another setup, other versions or other observers."""
        at = f"resume: {self.file}"
        afresh = "resume=read_checkpoint(...).snapshot goes on from its state alone, with new observers and another file"
        differ = [name for name, digest in setup_digest(setup).items() if self.digest.get(name) != digest]
        if differ:
            raise InputError(
                f"{at} is of another scene: {', '.join(differ)} differ; run the scene it was written by, or start anew with "
                "overwrite=True"
            )
        if self.versions != versions():
            raise InputError(f"{at} was written by {self.versions}, this is {versions()}: take those versions; {afresh}")
        known, present = [name for name, _ in self.observers], [repr(o) for o in observers if o.remembers]
        if known != present:
            listed = [", ".join(names) or "none" for names in (known, present)]
            raise InputError(f"{at} has the observers {listed[0]}, this run {listed[1]}: take the same ones; {afresh}")

    def write(self, path: Path) -> None:
        """Write `path`, whole or not at all; raises OutputError."""
        header = {
            "format": FORMAT, "versions": self.versions, "begin": self.begin, "time": self.snapshot.time,
            "meaning": dict(self.snapshot.meaning or {}), "seconds": self.seconds, "method": self.method,
            "digest": self.digest, "observers": [name for name, _ in self.observers],
            "steps": [as_list(step) for step in self.steps],
        }  # fmt: skip
        observers = {str(number): state for number, (_, state) in enumerate(self.observers)}
        tree = {"fields": self.snapshot.values, "stepper": self.stepper, "observers": observers, "log": self.log}
        write_tree(path, "Checkpoint", header, tree)


def read_checkpoint(path: str | Path) -> Restart:
    """What a `Checkpoint` wrote to `path`. Raises InputError for a file that is none, or is damaged."""
    path = checks.path("read_checkpoint", path, "run.checkpoint")
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; name the one that a Checkpoint wrote")
    remedy = "go on from a copy of it, choose another name, or start anew with overwrite=True"
    try:
        header, tree = read_tree(path)
        if header["format"] == FORMAT:
            return _restart(header, tree, path)
    except Exception as error:  # whatever damaged bytes make zipfile, numpy and json raise
        raise InputError(f"{path} is no checkpoint, or is cut short or damaged ({error}); {remedy}") from error
    raise InputError(
        f"{path} has the checkpoint format {header['format']} ({header.get('versions')}), this ngswell reads {FORMAT}; "
        "go on with the version that wrote it, choose another name, or start anew with overwrite=True"
    )


def _restart(header: dict[str, Any], tree: Tree, path: Path) -> Restart:
    observers = tree.get("observers", {})
    return Restart(
        Snapshot(header["time"], tree["fields"], header["meaning"]),
        header["begin"],
        tuple(from_list(entry) for entry in header["steps"]),
        tree["log"],
        header["seconds"],
        tree["stepper"],
        tuple((name, observers[str(number)]) for number, name in enumerate(header["observers"])),
        header["method"],
        header["digest"],
        header["versions"],
        path,
    )


def versions() -> str:
    """What computes here; another NGSolve may number unknowns differently."""
    return f"ngswell {__version__} on NGSolve {ngsolve.__version__}"
