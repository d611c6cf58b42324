"""The next part of a test: changed pieces from where an earlier part ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import Any, TypeVar

from ngswell import checks
from ngswell.baths.treatment import Charge
from ngswell.errors import InputError
from ngswell.schedules import LARGEST, Ramp, Schedule
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot

Following = TypeVar("Following", bound=Setup)


def following(setup: Following, end: Snapshot, start: float | None, changed: Mapping[str, Any]) -> Following:
    """The setup with some pieces `changed`, which starts from the fields of `end`; what `Scene.after` describes."""
    checks.instance("after", end, Snapshot, "a result or a snapshot of this scene")
    at = end.time if start is None else checks.number("after: start", start, "s", -LARGEST, LARGEST)
    salt, hydraulic = setup.initial_bath()
    known = all(value is None or checks.is_number(value) for value in (salt, hydraulic))
    result = replace(
        setup,
        start=at,
        origin=replace(end, time=at),
        initial=(salt, hydraulic) if known and setup.initial is None else setup.initial,
        **changed,
    )
    for name in ("charge", "baths", "loads", "supports"):
        for history in _histories(result, name):
            if name in changed:
                _check_ahead(name, history, at)
            elif at != end.time and not _constant(history):
                raise InputError(
                    f"after: {name} keep a history of the clock of the part before, which ends at {end.time:g} s; this part "
                    f"starts its clock at {at:g} s: give {name}= anew, or leave start out to keep the clock"
                )
    remember = any(treatment.charge_of is Charge.START for _, treatment in result.prescribed_baths)
    if remember and setup.charge.at(setup.start) != result.charge.at(at):
        raise InputError(
            "after: a bath keeps the charge of the very start (Frozen), but the charge has changed since; take another "
            "treatment"
        )
    return result


def _histories(setup: Setup, name: str) -> list[Schedule]:
    pieces = getattr(setup, name)
    return [pieces] if isinstance(pieces, Ramp) else [history for piece in pieces for history in piece.schedules]


def _constant(history: Schedule) -> bool:
    return not history.kinks and len(set(history.values)) == 1


def _check_ahead(name: str, history: Schedule, start: float) -> None:
    """Refuse a history that is over before it begins."""
    end = max((*history.kinks, *history.bends), default=inf)
    if end <= start:
        raise InputError(
            f"after: {name}: a history ends at {end:g} s, but this part starts at {start:g} s; give times on "
            "the clock of the part before, or start=0.0 to count from now; for what stays as it is one number is enough"
        )
