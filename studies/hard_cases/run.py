"""Hard cases: each passes with its error, or ends with an exception that says why and a usable last state.

Families, with both models, and every stable treatment of a bath where it makes a difference: `bath_range` and `penalties`
(`baths.py`), `sudden_steps` and `cycles` (`time.py`), `bonded` and `releases` (`bonded.py`), `charge`, `contrasts`,
`corner`, `compression`, `swelling`, `cells`, `joints`, `treatments` and `wrinkles` (each in the file of its name). The CSV
has a row an attempt; docs/hard_cases.md says what is compared and why each bound is what it is. An attempt is `wrong` if its
error exceeds its bound, its ledger does not close, or it leaves fields that are not finite and admissible. Numbers:

- `FAMILY_passes`, `FAMILY_stops` (StepError), `FAMILY_refused` (InputError), `FAMILY_wrong`: attempts;
- `attempts`, `passes`, `stops`, `refused`, `wrong`: of all families;
- `FAMILY_error_over_bound`, `FAMILY_imbalance`: the largest of those that pass;
- `alternation_lowest`, `alternation_above_limit`: lowest share of the jump [-] after one step, of all steps and of those
  with 6 κ Δt > h²; `alternation_difference` to the closed form;
- `skin_even`, `skin_graded`: error of a tight skin at the bath on 40 cells, relative;
- `corner_VARIANT_area`, `corner_VARIANT_arch`: errors of the area ratio [-] and of the arch [mm] on the finest mesh, and
  their `..._order` over the last refinement;
- `wrinkle_um`: amplitude of the seeded wrinkle on the finest mesh [µm], `wrinkle_change` from the next coarser one,
  relative; `wrinkle_hidden_um` with steps of 100 s, `wrinkle_unseeded_um` without a seed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

import numpy as np
from ngsolve import SetNumThreads
from tqdm import tqdm

from studies.hard_cases import baths, bonded, cells, charge, compression, contrasts, corner, joints, swelling, time, wrinkles
from studies.hard_cases.attempt import Attempt
from studies.hard_cases.figure import draw
from studies.hard_cases.treatments import treatments
from studies.output import Findings

FAMILIES: dict[str, Callable[[bool], list[Attempt]]] = {
    family.__name__: family
    for family in (
        baths.bath_range,
        charge.charge,
        time.sudden_steps,
        contrasts.contrasts,
        baths.penalties,
        treatments,
        time.cycles,
        corner.corner,
        bonded.bonded,
        bonded.releases,
        compression.compression,
        swelling.swelling,
        cells.cells,
        joints.joints,
        wrinkles.wrinkles,
    )
}
SERIES: dict[str, Callable[[bool], Any]] = {
    "alternation": time.alternation,
    "skin": contrasts.skin,
    "corner_errors": corner.corner_errors,
    "wrinkle_series": wrinkles.series,
}
OUTCOMES = ("passes", "stops", "refused", "wrong")
HEADER = (
    "family", "case", "variant", "outcome", "measure", "error", "bound", "imbalance", "steps", "rejected", "iterations",
    "seconds", "time_s", "message",
)  # fmt: skip


def run(quick: bool = False) -> Findings:
    """All families and series."""
    attempts, series = compute(quick)
    rows = [(family, *row(a)) for family, of_family in attempts.items() for a in of_family]
    return Findings(draw(attempts, series), HEADER, rows, numbers(attempts, series))


def compute(quick: bool) -> tuple[dict[str, list[Attempt]], dict[str, Any]]:
    """Attempts by family, and the series; one process a core: each alone takes one thread."""
    found: dict[str, Any] = {}
    tasks = FAMILIES | SERIES
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn"), SetNumThreads, (1,)) as pool:
        waiting = {pool.submit(task, quick): name for name, task in tasks.items()}
        with tqdm(total=len(tasks), desc="hard cases", disable=not sys.stderr.isatty(), leave=False) as bar:
            for done in as_completed(waiting):
                found[waiting[done]] = done.result()
                bar.update()
                if bar.disable:
                    print(f"hard_cases: {waiting[done]}", file=sys.stderr, flush=True)
    return {name: found[name] for name in FAMILIES}, {name: found[name] for name in SERIES}


def numbers(attempts: dict[str, list[Attempt]], series: dict[str, Any]) -> dict[str, float | int | str]:
    """How the attempts ended, what the series show, and what all of it cost."""
    everything = [a for of_family in attempts.values() for a in of_family]
    return {
        **counted(attempts),
        **measured(series),
        "mesh": "one a case: see the CSV and docs/hard_cases.md",
        "steps": sum(a.steps for a in everything),
        "rejected_steps": sum(a.rejected for a in everything),
        "newton_iterations": sum(a.iterations for a in everything),
        "seconds": round(sum(a.seconds for a in everything), 2),
    }


def row(a: Attempt) -> tuple[object, ...]:
    """An attempt for the table; what an attempt that did not pass has not is left empty."""
    values = (
        a.case, a.variant, a.outcome, a.measure, a.error, a.bound, a.imbalance, a.steps, a.rejected, a.iterations,
        round(a.seconds, 2), a.time, a.message,
    )  # fmt: skip
    return tuple("" if value is None else value for value in values)


def counted(attempts: dict[str, list[Attempt]]) -> dict[str, float | int | str]:
    """How the attempts ended."""
    numbers: dict[str, float | int | str] = {}
    for name, family in attempts.items():
        for outcome in OUTCOMES:
            numbers[f"{name}_{outcome}"] = sum(a.outcome == outcome for a in family)
        passing = [a for a in family if a.outcome == "passes"]
        numbers[f"{name}_error_over_bound"] = max(a.over_bound for a in passing)
        numbers[f"{name}_imbalance"] = max(a.imbalance or 0.0 for a in passing)
    everything = [a for family in attempts.values() for a in family]
    numbers["attempts"] = len(everything)
    for outcome in OUTCOMES:
        numbers[outcome] = sum(a.outcome == outcome for a in everything)
    return numbers


def measured(found: dict[str, Any]) -> dict[str, float | int | str]:
    """The numbers of the series."""
    series, skin = found["alternation"], found["skin"]
    numbers: dict[str, float | int | str] = {
        "alternation_lowest": float(series["found"].min()),
        "alternation_above_limit": float(series["found"][series["r"] > 1 / 6].min()),
        "alternation_difference": float(np.abs(series["found"] - series["closed"]).max()),
    }
    for kind in ("even", "graded"):
        numbers[f"skin_{kind}"] = float(skin[kind][skin["cells"] == 40][0])
    by_variant: dict[str, list[tuple[Any, ...]]] = {}
    for variant, *rest in found["corner_errors"]:
        by_variant.setdefault(variant.lower().replace(",", "").replace(" ", "_"), []).append(tuple(rest))
    for variant, meshes in by_variant.items():
        for quantity, index in (("area", 1), ("arch", 4)):
            coarse, fine = (float(mesh[index]) for mesh in meshes[-2:])
            numbers[f"corner_{variant}_{quantity}"] = fine
            numbers[f"corner_{variant}_{quantity}_order"] = float(np.log2(coarse / fine))
    *refined, hidden, unseeded = (1e3 * float(history.amplitude[-1]) for history in found["wrinkle_series"])
    numbers |= {"wrinkle_um": refined[-1], "wrinkle_change": abs(refined[-2] / refined[-1] - 1)}
    return numbers | {"wrinkle_hidden_um": hidden, "wrinkle_unseeded_um": unseeded}
