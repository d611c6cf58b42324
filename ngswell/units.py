"""Other units in those of the package, mm, N, s: `until=2 * year`, `K=1e-15 * metre**4`; and long times in words."""

from __future__ import annotations

hour = 3600.0
"""[s]"""
day = 24 * hour
"""[s]"""
year = 365.25 * day
"""[s]"""
micrometre = 1e-3
"""[mm]"""
metre = 1e3
"""[mm]"""
kPa = 1e-3
"""[N/mm²]"""
MPa = 1.0
"""[N/mm²]"""


def readable(seconds: float) -> str:
    """A time in seconds, from a day on also in days, from a year on in years: "8.64e+08 s (27.4 a)"."""
    size = abs(seconds)
    words = f" ({seconds / year:.3g} a)" if size >= year else f" ({seconds / day:.3g} d)" if size >= day else ""
    return f"{seconds:.10g} s{words}"
