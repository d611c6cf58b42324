"""Hard cases: a thin soft layer that swells on a stiff base wrinkles, and whether runs say so.

Two layers of Table 2 on a clamped base between symmetry planes, the bath on top diluted after a state of rest. Soft to the
surface it wrinkles beyond J = 2.496 (closed form, docs/convergence.md) with no length of its own, and folds. With a skin ten
times stiffer it wrinkles from 0.45 mol/l on with a length that skin and layer set, and the wrinkles stay small. A seed is a
cosine in the charge of the surface. What is asked of every run: that it does not end unstable without a word.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from ngsolve import IfPos, cos, exp, pi, x, y
from numpy.typing import NDArray

from ngswell import (
    TABLE_2,
    Adaptive,
    Bath,
    Fixed,
    InstabilityWarning,
    PlaneStrain,
    Probe,
    Ramp,
    Result,
    Roller,
    Scene,
    Stability,
    Symmetry,
    rectangle,
)
from ngswell.analysis.perturbations import Perturbations
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.stepping.steps import Control
from studies.hard_cases.attempt import DEFAULTS, Attempt, attempt

HEIGHT = 0.2  # mm, of the layer with its skin
SKIN = 0.02  # mm
STIFFER = 10.0  # shear modulus of the skin over that of the layer
DILUTED = 60.0  # s, end of the ramp of the bath
CELLS = ((24, 8), (36, 12), (48, 16))
"""With two, three and four cells across the skin."""

FOLLOWING = Adaptive(1e-3)
HIDING = Fixed(100.0)


@dataclass(frozen=True)
class Layer:
    """A layer `width` [mm] wide, with a skin or soft to the surface, whose bath falls from `start` to `end` [mol/l].

    The charge of the surface has a part `seed` that goes as cos(π n x/width), n = `waves`: a wavelength of 2 width/n.
    """

    name: str
    width: float
    skin: bool
    start: float
    end: float
    waves: int
    until: float

    def scene(self, cells: tuple[int, int], seed: float, model: str = "Potential") -> Scene:
        depth = HEIGHT - y
        fade = IfPos(SKIN - depth, 1.0, 0.0) if self.skin else exp(-depth / 0.05)
        charge = 1 + seed * cos(self.waves * pi / self.width * x) * fade if seed else 1.0
        mu = TABLE_2.mu * IfPos(SKIN - depth, STIFFER, 1.0) if self.skin else TABLE_2.mu
        form, treatment = DEFAULTS[model]
        lines = {"y": HEIGHT - SKIN} if self.skin else None
        return Scene(
            mesh=rectangle(self.width, HEIGHT, *cells, grade={"top": 5.5 if self.skin else 3.0}, lines=lines),
            kinematics=PlaneStrain(),
            material=replace(TABLE_2, mu=mu, cfc0=TABLE_2.cfc0 * charge),
            model=form,
            supports=[Symmetry("left|right"), Roller("bottom", "xy")],
            baths=[Bath("top", c=Ramp((0, self.start), (DILUTED, self.end)), treatment=treatment)],
        )


SKINNED = Layer("stiff skin", 0.6, True, 0.6, 0.42, 5, 1000.0)
"""Past the limit at 0.45 mol/l; five half waves is what wrinkles first."""

BELOW = Layer("soft surface, short of the limit", 0.4, False, 0.3, 0.2, 4, 400.0)
"""To J = 2.31."""

BEYOND = Layer("soft surface, past the limit", 0.4, False, 0.3, 0.12, 4, 400.0)
"""To J = 2.59."""


class Surface(Observer):
    """Vertical displacement [mm] of the surface, and its cosines cos(π n x/width)."""

    def __init__(self, layer: Layer) -> None:
        super().__init__()
        self.width = layer.width
        self.x = (np.arange(256) + 0.5) / 256 * layer.width
        self._profiles: list[NDArray] = []

    def record(self, problem: Problem, time: float) -> None:
        points = problem.mesh(self.x, np.full(len(self.x), HEIGHT))
        self._profiles.append(problem.state.u(points)[:, 1])

    @property
    def profiles(self) -> NDArray:
        """One row a time."""
        return np.array(self._profiles)

    @property
    def amplitudes(self) -> NDArray:
        """Coefficients [mm] of n = 0 … 64, one row a time. 256 points at midpoints: exact for the cosines below 256."""
        cosines = np.cos(np.pi * np.outer(np.arange(65), self.x) / self.width)
        return self.profiles @ cosines.T * np.where(np.arange(65) > 0, 2, 1) / len(self.x)

    def wavelength(self) -> float:
        """Of the largest cosine at the end [mm]."""
        return 2 * self.width / (1 + int(np.argmax(np.abs(self.amplitudes[-1, 1:]))))


def growth_left(scene: Scene, result: Result) -> float:
    """Rate [1/s] of the fastest perturbation of the state that a run ended in, 0 if none grows within the run's time."""
    problem = Problem(scene)
    problem.restore(result.end)
    found = Perturbations(problem).fastest(1 / result.end.time)
    return found.rate if found else 0.0


def judged(
    layer: Layer, seed: float, steps: Control, observers: Sequence[Observer] = (), model: str = "Potential", cells: int = 0
) -> Attempt:
    """A run that ends where nothing grows, says with a warning that it does not, or stops where an observer watches."""
    kind = "Adaptive" if isinstance(steps, Adaptive) else f"steps of {steps.step:g} s" if isinstance(steps, Fixed) else ""
    return attempt(
        f"{layer.name}, {f'seed {seed:g}' if seed else 'no seed'}, {kind}",
        model,
        lambda: layer.scene(CELLS[cells] if layer.skin else (16, 6), seed, model),
        layer.until,
        "growth of the last state without a word [1/s]",
        growth_left,
        0.0,
        steps,
        observers,
        start=Scene.equilibrate,
        ledger_bound=1e-3,  # Adaptive's nonlinear solves leave a small part of its tolerance
        says=InstabilityWarning,
    )


def seeded(layer: Layer, cells: tuple[int, int], seed: float, model: str, surface: Surface) -> Attempt:
    """A run whose wrinkles have to have the seed's wavelength; growth, if any, is followed."""

    def error(scene: Scene, result: Result) -> float:
        return abs(surface.wavelength() / (2 * layer.width / layer.waves) - 1) + growth_left(scene, result)

    return attempt(
        f"{layer.name}, seed {seed:g}, {cells[0]} × {cells[1]}",
        model,
        lambda: layer.scene(cells, seed, model),
        layer.until,
        "wavelength over the seed's, less one, and growth left",
        error,
        1e-12,  # the same cosine: the next differs by a tenth and more
        FOLLOWING,
        [surface, Stability(follow=True)],
        start=Scene.equilibrate,
        ledger_bound=1e-3,
    )


def refinement(
    layer: Layer, seed: float, meshes: Sequence[tuple[int, int]], model: str = "Potential"
) -> tuple[list[Attempt], list[float]]:
    """Attempts on `meshes`, and the amplitudes of the seed's cosine that they end with [mm]."""
    attempts, amplitudes = [], []
    for cells in meshes:
        surface = Surface(layer)
        attempts.append(seeded(layer, cells, seed, model, surface))
        amplitudes.append(float(surface.amplitudes[-1, layer.waves]))
    return attempts, amplitudes


def past_the_limit(quick: bool) -> list[Attempt]:
    """Runs past the limit as a user makes them who does not think of stability: they end with a warning."""
    attempts = []
    for model in ("Potential",) if quick else DEFAULTS:
        run = partial(judged, model=model)
        attempts += [run(SKINNED, 0.0, FOLLOWING), run(SKINNED, 1e-2, HIDING), run(BEYOND, 0.0, HIDING)]
        attempts.append(run(SKINNED, 1e-4, FOLLOWING))  # steps find the wrinkled state, which is stable
        if not quick:
            attempts += [run(SKINNED, 0.0, HIDING), run(BEYOND, 0.0, Adaptive(1e-2)), run(BEYOND, 1e-3, HIDING)]
    return attempts


def wrinkles(quick: bool) -> list[Attempt]:
    """The family."""
    attempts = past_the_limit(quick)
    attempts.append(judged(SKINNED, 1e-2, HIDING, [Stability(follow=True)]))  # stops
    for model in ("Potential",) if quick else DEFAULTS:
        attempts += refinement(SKINNED, 1e-2, CELLS[: 2 if quick else 3], model)[0]
    if not quick:
        attempts += refinement(BELOW, 1e-3, ((16, 6), (24, 9), (32, 12)))[0]
        # Seeded past the limit, a soft surface folds at once: adaptive steps follow until it does.
        attempts.append(judged(replace(BEYOND, end=0.14), 1e-3, Adaptive(1e-2), [Stability(follow=True)]))
    return attempts


@dataclass(frozen=True)
class SurfaceHistory:
    """One run of the skinned layer: times [s], J at half height, the seed's amplitude [mm], the last surface [mm]."""

    name: str
    time: NDArray
    J: NDArray
    amplitude: NDArray
    x: NDArray
    surface: NDArray


def series(quick: bool) -> list[SurfaceHistory]:
    """What a figure shows: the seeded skin on all meshes, followed; and what runs without a watch make of it."""
    runs: list[tuple[str, tuple[int, int], float, Control]] = [
        (f"{nx} × {ny}", (nx, ny), 1e-2, FOLLOWING) for nx, ny in CELLS[: 2 if quick else 3]
    ]
    runs += [("seed, steps of 100 s", CELLS[0], 1e-2, HIDING), ("no seed", CELLS[0], 0.0, FOLLOWING)]
    histories = []
    for name, cells, seed, steps in runs:
        scene, surface = SKINNED.scene(cells, seed), Surface(SKINNED)
        probe = Probe((SKINNED.width / 2, HEIGHT / 2), "J")
        scene.run(SKINNED.until, steps, [surface, probe], resume=scene.equilibrate(), unstable="off")
        amplitude = surface.amplitudes[:, SKINNED.waves]
        histories.append(SurfaceHistory(name, surface.time, probe.values["J"], amplitude, surface.x, surface.profiles[-1]))
    return histories
