"""What a rank runs that ends badly: `python -m tests.ranks.ends NAME`."""

from __future__ import annotations

import sys

from ngswell import Fixed, Progress, Scene
from ngswell.calls import warn
from ngswell.team import everyone
from tests.scenes import quarter

STEPS = Fixed(5.0)


def all_of_them(scene: Scene) -> None:
    scene.run(10, STEPS, [lambda time, state: [][0]])


def one(scene: Scene) -> None:
    def fails(time: float, state: object) -> None:
        if time > 5 and everyone().rank == 1:
            raise MemoryError("no room")

    scene.run(50, STEPS, [fails])


def one_that_is_caught(scene: Scene) -> None:
    try:
        one(scene)
    except MemoryError:
        scene.run(10, STEPS)


def after_the_run(scene: Scene) -> None:
    scene.run(10, STEPS, [Progress("swelling")])
    warn(UserWarning("doubtful"))
    if everyone().rank == 1:
        raise KeyError("mine")


def leaves(scene: Scene) -> None:
    if everyone().rank == 1:
        sys.exit(0)
    scene.run(50, STEPS)


if __name__ == "__main__":
    globals()[sys.argv[1]](quarter(cells=4, ranks=True))
