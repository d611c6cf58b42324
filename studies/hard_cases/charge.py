"""No charge, much charge, and charges that fall to zero."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import pi
from typing import Any

import numpy as np
from ngsolve import x, y
from numpy.typing import NDArray

from ngswell import TABLE_1, Adaptive, Fixed, Ramp, Result, Scene, Traction
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from studies.hard_cases.attempt import CHOICES, DEFAULTS, Attempt, attempt
from studies.hard_cases.bodies import ACCURATE, column_scene, distance, strip_scene
from studies.scenes import BATH, COLUMN_HEIGHT, rest_load

UNCHARGED = replace(TABLE_1, cfc0=0.0)
CHARGED = replace(TABLE_1, cfc0=2.0)


def salt_series(places: NDArray, step: float, count: int, before: float, after: float) -> NDArray:
    """Salt [mol/l] at `places` above the sealed bottom, after `count` steps of backward Euler from a change of the bath.

    Fick's law with the ambipolar D = 2 D₊ D₋/(D₊ + D₋), whatever the porosity: modes cos(αx), α = (n + ½) π/h.
    """
    m = TABLE_1
    D = 2 * m.number("D_plus") * m.number("D_minus") / (m.number("D_plus") + m.number("D_minus"))
    n = np.arange(2000)
    wave = (n + 0.5) * pi / COLUMN_HEIGHT
    left = 2 * (-1.0) ** n / (wave * COLUMN_HEIGHT) * np.exp(-count * np.log1p(D * wave**2 * step))
    return after + (before - after) * np.cos(np.outer(places, wave)) @ left


def charge(quick: bool) -> list[Attempt]:
    """No charge, a charge of 2 mol/l, and charges that fall to zero along the column.

    - none: salt diffuses by Fick, nothing deforms. J − 1 is round-off. Salt against its Fourier series in the same steps,
      cubic u and quadratic salt on 20 cells: 2e-6 of the bath; a penalty of 1e4 D₊/h adds 5e-6 of the column's resistance.
    - 2 mol/l: rest by the closed form, from the loaded reference state to a bath of 0.01 mol/l at once, and unloaded with
      the charge raised. New charge comes with no cations but at the cost of anions: raised in 1e3 s, faster than salt
      diffuses in (400 s for the column, at a hundredth of the charge), they run out. 1e7 s leave nothing of the transient.
    - varying: at rest each point of a confined column obeys the closed form for its own charge. Between the nodes J is
      linear in a cell, and no better than the interpolant of the closed form: twice its error, h²/8 max |J″|, is the bound.
    """
    holding = rest_load(CHARGED)
    loaded = homogeneous_equilibrium(CHARGED, 0.01, "confined", load=holding).J
    swollen = homogeneous_equilibrium(CHARGED, BATH, "confined").J
    found = []

    def strong(title: str, name: str, J: float, bath: float, **scene: Any) -> None:
        make = partial(column_scene, *CHOICES[name], bath, 10, CHARGED, **scene)
        error = partial(distance, {"J": lambda *at: J}, 4)
        found.append(attempt(title, name, make, 1e7, "J", error, 1e-8, Adaptive(1e-2), newton=ACCURATE))

    for name in CHOICES:
        found += [fick(name, measure) for measure in ("J", "c₊")]
        strong(f"2 mol/l, loaded, {BATH:g} → 0.01 mol/l at once", name, loaded, 0.01, loads=[Traction("top", (-holding,))])
        for within in (1e5,) if quick or name != "Potential" else (1e5, 1e3):  # that salt is late is the same for all
            raised = Ramp((0.0, 0.0), (within, 1.0))
            strong(f"2 mol/l, unloaded, raised in {within:g} s", name, swollen, BATH, loads=(), charge=raised)
        for end in ("bath", "bottom"):
            found += [varying(name, end, "1-d", cells) for cells in ((20,) if quick else (20, 40))]
            if name in DEFAULTS:
                found.append(varying(name, end, "2-d", 20))
    return found


def fick(name: str, measure: str) -> Attempt:
    """Salt enters an uncharged column, 0.15 → 5 mol/l at once."""
    model: Any
    model, treatment = CHOICES[name]
    places, after, count = np.array([0.01, 0.1, 0.26, 0.4]), 5.0, 20
    series = salt_series(places, 5.0, count, BATH, after)

    def error(scene: Scene, result: Result) -> float:
        output, values = ("J", 1.0) if measure == "J" else ("c_plus", series)
        field = result.state.output(output)
        return float(np.abs(np.array([field(scene.mesh(at)) for at in places]) / values - 1).max())

    return attempt(
        f"no charge, {BATH:g} → {after:g} mol/l at once",
        name,
        partial(column_scene, replace(model, order=3), treatment, after, 20, UNCHARGED, loads=()),
        5.0 * count,
        measure,
        error,
        1e-12 if measure == "J" else 2e-5,
        Fixed(5.0),
        newton=ACCURATE,
    )


def varying(name: str, end: str, where: str, cells: int) -> Attempt:
    """A charge of 0.2 mol/l that falls linearly to zero at one end, in 0.05 mol/l, at rest."""
    bath, load = 0.05, 0.05
    scene_of, field, traction = (column_scene, x, (-load,)) if where == "1-d" else (strip_scene, y, (0.0, -load))

    def charge_at(at: Any) -> Any:
        return 0.2 * (1 - at / COLUMN_HEIGHT if end == "bath" else at / COLUMN_HEIGHT)

    def rest(*at: float) -> float:
        local = replace(TABLE_1, cfc0=float(charge_at(at[-1])))
        return homogeneous_equilibrium(local, bath, "confined", load=load).J

    fine = np.linspace(0.0, COLUMN_HEIGHT, 101)
    values = np.array([rest(at) for at in fine])
    curvature = float(np.abs(np.diff(values, 2)).max()) / (fine[1] - fine[0]) ** 2
    material = replace(TABLE_1, cfc0=charge_at(field))
    return attempt(
        f"charge falls to zero at the {end}, {where}, {cells} cells",
        name,
        partial(scene_of, *CHOICES[name], bath, cells, material=material, loads=[Traction("top", traction)]),
        1e6,
        "J",
        partial(distance, {"J": rest}, 23),
        2 * curvature * (COLUMN_HEIGHT / cells) ** 2 / 8 / float(values.min()),
        Adaptive(1e-2),
        newton=ACCURATE,
    )
