"""What every study writes: NAME.png, NAME.csv and NAME.json; letters of the panels."""

from __future__ import annotations

import csv
import importlib.metadata
import json
import math
import platform
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from string import ascii_lowercase

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ngswell import OutputError, Result, __version__
from ngswell.files import check_folder, replacing
from ngswell.solve.factors import best_solver

SUFFIXES = (".png", ".csv", ".json")


@dataclass(frozen=True)
class Findings:
    """A study's figure, its series (header and rows) and its numbers (flat keys)."""

    figure: Figure
    header: Sequence[str]
    rows: Sequence[Sequence[object]]
    numbers: dict[str, float | int | str]


def prepare(folder: Path, names: Sequence[str], overwrite: bool) -> None:
    """Make the folder and refuse what could not be written, before anything is computed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"the folder {folder} cannot be made: {error.strerror}") from error
    check_folder(folder, "studies")
    for name in names:
        for suffix in SUFFIXES:
            file = folder / (name + suffix)
            if file.exists() and not overwrite:
                raise OutputError(f"{file} exists; choose another folder with --out or pass --overwrite")


def write(folder: Path, name: str, findings: Findings) -> None:
    """Write the three files of a study, all or none; raises OutputError."""
    for key, value in findings.numbers.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{name}: {key} is {value}")
    with ExitStack() as files:
        png, table, numbers = (files.enter_context(replacing(folder / (name + suffix), name)) for suffix in SUFFIXES)
        findings.figure.savefig(png)
        with open(table, "w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow(findings.header)
            rows.writerows([[f"{x:.10g}" if isinstance(x, float) else x for x in row] for row in findings.rows])
        with open(numbers, "w", encoding="utf-8") as file:
            json.dump({**findings.numbers, **_versions()}, file, indent=2)
            file.write("\n")


def cost(results: Sequence[Result]) -> dict[str, float | int]:
    """Steps, rejected steps, Newton iterations and seconds of several runs together."""
    return {
        "steps": sum(len(r.steps) for r in results),
        "rejected_steps": sum(r.rejections for r in results),
        "newton_iterations": sum(r.iterations for r in results),
        "seconds": round(sum(r.seconds for r in results), 2),
    }


def letter_panels(panels: Iterable[Axes], pad: float | None = None) -> None:
    """Put (a), (b), ... before the titles of the panels, all of them flush left, `pad` points above; call it last."""
    for letter, ax in zip(ascii_lowercase, panels, strict=False):
        title = ax.get_title("left") or ax.get_title("center")
        ax.set_title("")
        ax.set_title(f"({letter}) {title}".rstrip(), loc="left", pad=pad)


def _versions() -> dict[str, str]:
    versions = {f"version_{package}": importlib.metadata.version(package) for package in ("ngsolve", "numpy")}
    return {
        "version_ngswell": __version__,
        **versions,
        "version_python": platform.python_version(),
        "linear_solver": best_solver(),
    }
