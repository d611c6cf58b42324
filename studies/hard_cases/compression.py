"""Near the compression point, and beyond what a body can bear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from ngswell import TABLE_1, Adaptive, Fixed, Material, PowerLaw, Scene, Traction
from ngswell.baths.treatment import Treatment
from ngswell.models.model import Model
from ngswell.physics import donnan
from ngswell.setup.snapshot import Snapshot
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, AT_REST, Choice, directly, never, off
from studies.scenes import BATH, confined_column, strip

SQUEEZED = 1e-2
"""Fluid that is left, over that of the reference configuration."""

UNCHARGED = replace(TABLE_1, cfc0=0.0)
SOFT = replace(UNCHARGED, lam=0.0)
SQUEEZABLE: dict[str, Material] = {
    "charged": TABLE_1,
    "charged, λ = 0": replace(TABLE_1, lam=0.0),
    "uncharged": UNCHARGED,
    "charged, K → 0": replace(TABLE_1, permeability=PowerLaw(m=2.0)),
    "uncharged, K → 0": replace(UNCHARGED, permeability=PowerLaw(m=2.0)),
}


def load_at(material: Material, J: float, bath: float = BATH) -> float:
    """Load under which a confined body is at rest at J: the equation of `homogeneous_equilibrium` [N/mm²]."""
    mu, lam, nS0, cfc0 = (material.number(name) for name in ("mu", "lam", "nS0", "cfc0"))
    extra = mu * (J * J - 1) + lam * (1 - nS0) ** 2 * (J / (1 - nS0) - J / (J - nS0))
    return donnan.pressure(bath, (1 - nS0) * cfc0 / (J - nS0), material.RT) - extra / J


def pressed(material: Material, load: float, model: Model, treatment: Treatment, block: bool = False) -> Scene:
    """A column of 0.5 mm, or a block as high between lateral guides, under a load [N/mm²] on its bath's boundary."""
    parts: dict[str, Any] = {"material": material, "model": model}
    if block:
        return strip(treatment, BATH, (3, 6), 0.5, loads=[Traction("top", (0.0, -load))], **parts)
    return confined_column(treatment, BATH, 10, loads=[Traction("top", (-load,))], **parts)


def by_levels(choice: Choice, load: float, levels: int, each: float, scene: Scene) -> Snapshot:
    """A start for the column: after so many levels of `each` [s] from the load of J = 1 to `load`, by equal factors."""
    first, state = load_at(TABLE_1, 1.0), None
    for number in range(levels):
        level = pressed(TABLE_1, first * (load / first) ** (number / levels), *choice)
        state = level.run((number + 1) * each, Adaptive(1e-2), resume=state).end
    assert state is not None
    return state


def compression(quick: bool) -> list[Attempt]:
    """Squeezed to 1 % of its fluid by a load of 2 (uncharged) to 51 N/mm² (charged; 200 times µ), and beyond.

    The load is that of the closed form, at once from the reference configuration, by levels (`resume` from scene to scene),
    in huge steps, and by `equilibrate`. Error: of the fluid content J − nS0 at rest; the state is homogeneous, so `AT_REST`
    bounds it, once it has come to rest. Without charge and λ only µ (1 − nS0²)/nS0 = 0.9 N/mm² resists: loads beyond must
    end in StepError with all contents positive. With charge there is an equilibrium under any load.
    """
    J = TABLE_1.number("nS0") + SQUEEZED * (1 - TABLE_1.number("nS0"))
    error = off(J, TABLE_1.number("nS0"))
    found: list[Attempt] = []

    def add(case: str, variant: str, make: Callable[[], Scene], until: float = 1e5, **options: Any) -> None:
        found.append(attempt(case, variant, make, until, "fluid content", error, AT_REST, newton=ACCURATE, **options))

    for case, material in SQUEEZABLE.items():
        if quick and case not in ("charged, λ = 0", "uncharged, K → 0"):
            continue
        load = load_at(material, J)
        for name, choice in (CHOICES if material is TABLE_1 and not quick else DEFAULTS).items():
            make = partial(pressed, material, load, *choice)
            end = 1e5 if material.permeability == TABLE_1.permeability else 1e6  # where K falls, rest takes longer
            add(f"1 % left, {case}", f"{name}, at once", make, end, steps=Adaptive(1e-2))
            add(f"1 % left, {case}", f"{name}, huge steps", make, end, steps=Fixed(end / 10))
            add(f"1 % left, {case}", f"{name}, equilibrate", make, 1.0, steps=Fixed(1.0), start=directly)
    load = load_at(TABLE_1, J)
    for name, choice in DEFAULTS.items():
        make = partial(pressed, TABLE_1, load, *choice)
        add("1 % left, charged", f"{name}, by levels", make, start=partial(by_levels, choice, load, 8, 100.0))
        add("1 % left, charged block", f"{name}, at once", partial(make, block=True), steps=Adaptive(1e-2))
    return found + beyond()


def beyond() -> list[Attempt]:
    """Loads under which there is no equilibrium: µ (1 − nS0²)/nS0 and 1 % more, and five times that.

    Where K falls to nothing with the fluid, a prescribed bath still asks for what cannot be; a weak one would close, and the
    column collapse for ever longer.
    """
    nS0 = SOFT.number("nS0")
    limit = SOFT.number("mu") * (1 - nS0**2) / nS0
    fading = replace(SOFT, permeability=PowerLaw(m=2.0))
    at_once, huge = {"steps": Adaptive(1e-2)}, {"steps": Fixed(1e4)}
    rest: dict[str, Any] = {"steps": Fixed(1.0), "start": directly}
    cases: list[tuple[str, Material, float, str, str, dict[str, Any]]] = [
        ("", SOFT, 1.01 * limit, "Potential", "at once", at_once),
        ("", SOFT, 1.01 * limit, "Concentration", "equilibrate", rest),
        ("", SOFT, 5 * limit, "Concentration", "huge steps", huge),
        (", K → 0", fading, 1.01 * limit, "Potential", "equilibrate", rest),
    ]
    found = []
    for case, material, load, name, way, options in cases:
        make = partial(pressed, material, load, *DEFAULTS[name])
        title, variant = f"no equilibrium, {load:.3g} N/mm²{case}", f"{name}, {way}"
        found.append(attempt(title, variant, make, 1e5, "passing is wrong", never, 0.0, newton=ACCURATE, **options))
    return found
