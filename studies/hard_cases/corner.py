"""Baths that meet at a corner without a blend."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

from ngswell import Area, Bath, Essential, Fixed, Potential, Probe, Ramp, Result, Scene, rectangle
from ngswell.baths.treatment import Treatment
from ngswell.models.model import Model
from studies.hard_cases.attempt import CHOICES, Attempt, attempt
from studies.scenes import BLENDED, HEIGHT, INITIAL, SIDE, WIDTH, blended_baths, free_swelling_block

APART, STEP = 7400.0, 20.0  # s: when the block is compared, and the steps
OTHER = Ramp((7000, 4.1), (7080, 2.7))  # mol/l: the bottom's bath; the sides' falls on to 0.3 until 7220 s
FINE = {"left": 20.0, "bottom": 20.0, "top": 20.0}


class Corner(NamedTuple):
    """The free-swelling block at 7400 s: area over that at the start, J of the core, displacement of the free top corner,
    rise of the bottom's middle over the corner in which the baths meet [mm]."""

    area: float
    core: float
    far: float
    arch: float


def block_with_corner(
    cells: int,
    model: Model,
    treatment: Treatment,
    width: float = 0.0,
    grade: dict[str, float] | None = None,
    bottom_first: bool = False,
) -> Scene:
    """The free-swelling block with baths that jump where they meet, or blend over `width` [mm]."""
    baths = [Bath("top|left", c=SIDE, treatment=treatment), Bath("bottom", c=OTHER, treatment=treatment)]
    if width:
        baths = blended_baths(treatment, OTHER, width)
    mesh = rectangle(WIDTH, HEIGHT, cells, cells, grade=grade)
    return free_swelling_block(1, 1, mesh=mesh, model=model, baths=baths[::-1] if bottom_first else baths)


class _Watch:
    def __init__(self) -> None:
        self.area, self.core = Area(), Probe((WIDTH, HEIGHT / 2), "J")
        self.far, self.arch = (Probe(point, "displacement") for point in ((0.0, HEIGHT), (WIDTH, 0.0)))
        self.observers = [self.area, self.core, self.far, self.arch]

    @property
    def end(self) -> Corner:
        moved = (probe.values["displacement"][-1] for probe in (self.far, self.arch))
        far, arch = next(moved)[0], next(moved)[1]
        return Corner(*map(float, (self.area.values[-1] / self.area.values[0], self.core.values["J"][-1], far, arch)))

    def away(self, exact: Corner, scene: Scene, result: Result) -> float:
        return away(self.end, exact)


def at_corner(*arguments: Any, **options: Any) -> Corner:
    """What the block is like at 7400 s; arguments of `block_with_corner`."""
    scene, watch = block_with_corner(*arguments, **options), _Watch()
    scene.run(APART, Fixed(STEP), watch.observers, resume=scene.equilibrate(INITIAL))
    return watch.end


def corner_reference(cells: int, width: float = 0.0, bottom_first: bool = False) -> Corner:
    """Potential of order 3 on a mesh graded towards the baths, with the same time steps."""
    return at_corner(cells, Potential(order=3), Essential(), width, FINE, bottom_first)


def away(found: Corner, exact: Corner) -> float:
    """Largest difference of area, core J and far displacement [mm]: what the corner spoils elsewhere."""
    return max(abs(a - b) for a, b in zip(found[:3], exact[:3], strict=True))


def corner(quick: bool) -> list[Attempt]:
    """Two baths of 0.3 and 2.7 mol/l meet at a corner without a blend: the boundary data jump.

    Compared at 7400 s, with a reference of order 3, graded, in the same time steps: area, core J and the far displacement. A
    jump at a right angle changes the data over one cell, where the flux into the body vanishes with the distance to the
    corner: what it spoils elsewhere goes with h² up to a logarithm, as the discretisation itself. Bound: twice the error of
    the same mesh with the baths blended over the paper's 0.3 mm.
    """
    cells, fine = (5, 10) if quick else (10, 20)
    sharp, blended = corner_reference(fine), corner_reference(fine, BLENDED)
    found = []
    for name, choice in CHOICES.items():
        watch = _Watch()
        bound = 2 * away(at_corner(cells, *choice, width=BLENDED), blended)
        found.append(
            attempt(
                "baths jump at a corner",
                name,
                partial(block_with_corner, cells, *choice),
                APART,
                "area, core J, far displacement",
                partial(watch.away, sharp),
                bound,
                Fixed(STEP),
                watch.observers,
                start=partial(Scene.equilibrate, time=INITIAL),
            )
        )
    return found


def corner_errors(quick: bool) -> list[tuple[Any, ...]]:
    """Rows (variant, cells a side, errors of area, core J, far displacement and arch): orders under refinement.

    "bottom first": in the corner's node the bottom's bath prescribes.
    """
    fine = 10 if quick else 20
    exact, blended = corner_reference(fine), corner_reference(fine, BLENDED)
    variants: dict[str, tuple[dict[str, Any], Corner]] = {
        "Potential": ({}, exact),
        "Potential, bottom first": ({"bottom_first": True}, exact),
        "Potential, Penalty": ({}, exact),
        "Concentration": ({}, exact),
        "Potential, blended over 0.3 mm": ({"width": BLENDED}, blended),
    }
    rows = []
    for name, (options, reference) in variants.items():
        choice = CHOICES[name if name in CHOICES else "Potential"]
        for cells in (4, 8) if quick else (5, 10, 20):
            ends = at_corner(cells, *choice, **options)
            rows.append((name, cells, *(abs(a - b) for a, b in zip(ends, reference, strict=True))))
    return rows
