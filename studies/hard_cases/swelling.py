"""Gels that swell to ten and a hundred times their volume."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from ngswell import TABLE_2, Adaptive, Fixed, Material, Ramp, Scene, box, column, rectangle
from ngswell.closed_forms.homogeneous import FREE_DIRECTIONS
from ngswell.physics import donnan
from ngswell.schedules import Schedule
from studies.hard_cases.attempt import DEFAULTS, Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, AT_REST, Choice, directly, free_body, off, solid_body
from studies.scenes import confined_column

SALTY, DILUTE = 2.7, 0.1  # mol/l
DILUTIONS = {"at once": 1e-3, "within 1e+04 s": 1e4}  # s


def soft_gel(J: float, motion: str) -> Material:
    """Table 2 with the µ = 6 λ that lets a body of this motion swell to `J` in the dilute bath."""
    charge = (1 - TABLE_2.number("nS0")) * TABLE_2.number("cfc0") / (J - TABLE_2.number("nS0"))
    shape = J ** (2 / FREE_DIRECTIONS[motion]) - 1
    shape += (1 - TABLE_2.number("nS0")) ** 2 / 6 * (J / (1 - TABLE_2.number("nS0")) - J / (J - TABLE_2.number("nS0")))
    mu = J * donnan.pressure(DILUTE, charge, TABLE_2.RT) / shape
    return replace(TABLE_2, mu=mu, lam=mu / 6)


def swelling_body(motion: str, material: Material, cells: int, choice: Choice, c: float | Schedule) -> Scene:
    """A column, a quarter of a block in plane strain, or an eighth of a cube of 1 mm, its other sides in the bath."""
    model, treatment = choice
    if motion == "plane strain":
        return free_body(rectangle(1.0, 1.0, cells, cells), model, treatment, c, material)
    if motion == "3-d":
        return solid_body(box(1.0, 1.0, 1.0, cells, cells, cells), model, treatment, c, material)
    return confined_column(treatment, c, mesh=column(1.0, cells), material=material, model=model, loads=())


def swelling(quick: bool) -> list[Attempt]:
    """Gels so soft that they swell to 10, 30 and 100 times their volume, directly and when 2.7 mol/l are diluted to 0.1.

    Error: of the volume at rest against the closed form. The state is homogeneous: `AT_REST` bounds it once it has come to
    rest, which a soft gel takes long to do (up to 1e13 s for a millimetre). A ledger that closes to 1e-7 says that nothing
    was lost on the way. The rim of a free body swells first and is held by its core: where it wrinkles, as on the 2 × 2 × 2
    cells of a cube at J = 30, the tangent without flow has negative eigenvalues (`spectra.undrained`) and the run stops.
    """
    found = []
    for motion, cells in {"confined": 10, "plane strain": 4, "3-d": 2}.items():
        for J in (10.0, 100.0) if quick else (10.0, 30.0, 100.0):
            material = soft_gel(J, motion)
            for name, choice in DEFAULTS.items():
                body = partial(swelling_body, motion, material, cells, choice)
                common: dict[str, Any] = {"measure": "volume", "error": off(J), "bound": AT_REST, "newton": ACCURATE}
                case, step = f"J = {J:g}, {motion}", Fixed(1.0)
                make = partial(body, DILUTE)
                found.append(attempt(case, f"{name}, equilibrate", make, 1.0, steps=step, start=directly, **common))
                if motion == "3-d" and (quick or J == 100.0):
                    continue
                for way, time in list(DILUTIONS.items())[: 1 if quick else 2]:
                    # The point at 1e6 s only divides the run: steps are refused below 1e-12 of what is left to the next.
                    make = partial(body, Ramp((0, SALTY), (time, DILUTE), (1e6, DILUTE)))
                    steps = Adaptive(1e-2)
                    found.append(attempt(case, f"{name}, {way}", make, 1e13, steps=steps, start=directly, **common))
    return found
