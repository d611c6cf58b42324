"""CPU times of actions that take turns; without ngswell, for every code that is compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from statistics import median
from time import process_time


def milliseconds(actions: Mapping[str, Callable[[], object]], turns: int) -> dict[str, float]:
    """The median of each action over `turns`, in each of which all are taken one after the other."""
    taken: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(turns):
        for name, action in actions.items():
            clock = process_time()
            action()
            taken[name].append(1e3 * (process_time() - clock))
    return {name: median(times) for name, times in taken.items()}
