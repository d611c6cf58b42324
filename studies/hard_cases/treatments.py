"""Random columns with laws for permeability and diffusivity, at rest and on the way there, by every treatment of a bath."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ngswell import (
    Adaptive,
    Concentration,
    Essential,
    Fixed,
    HolmesMow,
    InputError,
    MackieMeares,
    Material,
    Multiplier,
    Nitsche,
    Penalty,
    Potential,
    PowerLaw,
    Ramp,
    Scene,
)
from ngswell.baths.treatment import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.physics.pores import Constant
from ngswell.setup.snapshot import Snapshot
from studies.hard_cases.attempt import Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, AT_REST, directly, off
from studies.scenes import COLUMN_HEIGHT, confined_column

ALL: dict[str, tuple[type[Potential] | type[Concentration], Treatment]] = {
    "Potential": (Potential, Essential()),
    "Potential, Penalty": (Potential, Penalty(relative=1e4)),
    "Concentration": (Concentration, Penalty(relative=1e4)),
    "Concentration, ε = 40": (Concentration, Penalty(40.0)),
    "Concentration, Multiplier": (Concentration, Multiplier()),
    "Concentration, Nitsche": (Concentration, Nitsche()),
    "Concentration, Nitsche, γ = 20": (Concentration, Nitsche(20.0)),
    "Concentration, Nitsche, none": (Concentration, Nitsche(5.0, "none")),
    "Concentration, Nitsche, skew": (Concentration, Nitsche(5.0, "skew")),
}
"""Every treatment that follows the charge, Nitsche's also at the smallest γ that they take."""

TRANSIENT = [name for name in ALL if not name.endswith(("none", "skew"))]
"""Those that a run would take: Nitsche's other variants are there for what they do at rest, and few anions end them."""

SWOLLEN = 4.0
"""Columns that would swell beyond are not drawn."""


class Drawn(NamedTuple):
    """A column: its material, baths before and after [mol/l], order and cells, and J at rest in the second bath."""

    material: Material
    before: float
    after: float
    order: int
    cells: int
    J: float

    @property
    def case(self) -> str:
        """What tells it from others."""
        laws = ", ".join(map(str, self.material.laws().values())) or "constant"
        return f"{self.before:.3g} → {self.after:.3g} mol/l, order {self.order}, {self.cells} cells: {laws}"


def drawn(seed: int) -> Drawn:
    """A random column that has a state of rest."""
    rng = np.random.default_rng(seed)

    def number(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    def size(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    while True:
        laws: dict[str, Any] = {
            "permeability": (Constant(), PowerLaw(number(0.5, 4.0)), HolmesMow(number(0.0, 3.0), number(0.0, 3.0)))[
                rng.integers(3)
            ],
            "diffusivity": (Constant(), MackieMeares())[rng.integers(2)],
        }
        if rng.random() < 0.5:
            laws |= {"phi": number(0.85, 1.1), "phi_bath": number(0.85, 1.1), "Gamma": number(0.9, 1.1)}
        mu = size(0.03, 1.0)
        material = Material(
            mu=mu,
            lam=mu * float(rng.choice([0.0, 0.1, 1.0])),
            nS0=number(0.05, 0.5),
            cfc0=size(0.05, 1.0),
            D_plus=size(3e-4, 2e-3),
            D_minus=size(3e-4, 2e-3),
            K=size(1e-5, 1e-2),
            **laws,
        )
        before, after, order, cells = size(0.01, 3.0), size(0.01, 3.0), int(rng.integers(2, 7)), int(rng.integers(1, 9))
        try:
            rests = [homogeneous_equilibrium(material, salt, "confined").J for salt in (before, after)]
        except InputError:
            continue
        if max(rests) < SWOLLEN:
            return Drawn(material, before, after, order, cells, rests[1])


def column_of(case: Drawn, variant: str, duration: float = 0.0) -> Scene:
    """The column without a load, in its second bath, which takes over from the first within `duration` [s]."""
    model, treatment = ALL[variant]
    salt = Ramp((0, case.before), (duration, case.after)) if duration else case.after
    return confined_column(treatment, salt, case.cells, material=case.material, model=model(order=case.order), loads=())


def resting(scene: Scene) -> Snapshot:
    """Rest in the first bath."""
    return scene.equilibrate(0.0)


def treatments(quick: bool) -> list[Attempt]:
    """Columns of random materials, laws, baths, orders and cells: `equilibrate`, and a change of the bath until rest.

    Error: of J against its closed form. The state is homogeneous, so every space holds it, whatever the treatment:
    `AT_REST`. The bath changes within H²/(2µK), the time of the column by its parameters.
    """
    found = []
    for seed in range(4 if quick else 50):
        case = drawn(seed)
        common: dict[str, Any] = {"measure": "volume", "error": off(case.J), "bound": AT_REST, "newton": ACCURATE}
        for name in ALL:
            make = partial(column_of, case, name)
            found.append(attempt(case.case, f"{name}, equilibrate", make, 1.0, steps=Fixed(1.0), start=directly, **common))
        duration = COLUMN_HEIGHT**2 / (2 * case.material.number("mu") * case.material.number("K"))
        for name in TRANSIENT if quick else TRANSIENT[seed % 3 :: 3]:
            make = partial(column_of, case, name, duration)
            steps, until = Adaptive(1e-2), 1e5 * duration
            found.append(attempt(case.case, f"{name}, changed", make, until, steps=steps, start=resting, **common))
    return found
