"""What a setup's model leaves out where it matters."""

from __future__ import annotations

from ngswell.setup.setup import Setup


def limits(setup: Setup) -> list[str]:
    """Sentences for `describe()`: what outputs are good for; zero current at every point, (21), is more than div i = 0 in
    2-d and 3-d, most so between baths that differ."""
    found = []
    if setup.baths:
        good = "fluxes and stress, made of derivatives, are good inside cells"
        found.append(f"{good}; what passes a bath is in Outflow and Ledger, see docs/limits.md")
    unequal = any(bath.schedules != setup.baths[0].schedules for bath in setup.baths[1:])
    varied = any(not history.uniform for bath in setup.baths for history in bath.schedules)
    if setup.mesh.dim == 1 or "cations" not in setup.model.balanced or not (unequal or varied):
        return found
    current = "zero current at every point, (21), is more than conservation of charge"
    return [*found, f"{current}; with baths that differ it moves areas by several percent, see docs/limits.md"]
