"""Newton's method: what is refused; units do not matter."""

import math

import pytest

from ngswell import (
    Bath,
    DampedNewton,
    Fixed,
    InputError,
    Material,
    Penalty,
    PlaneStrain,
    Ramp,
    Roller,
    Scene,
    Traction,
    rectangle,
)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: DampedNewton(math.nan), "tolerance = nan"),
        (lambda: DampedNewton(most_iterations=0), "most_iterations 0"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_newton_does_not_depend_on_units():
    """The same scene with a stress and a length scaled: the same iterations, scaled results."""
    counts, ends = [], []
    for stress in (1.0, 1e-3):
        material = Material(
            mu=0.12 * stress, lam=0.02 * stress, nS0=0.25, cfc0=0.8, D_plus=5e-4, D_minus=8e-4, K=1.07e-3 / stress,
            theta=298.0,
        )  # fmt: skip
        scene = Scene(
            mesh=rectangle(1.0, 1.0, 3, 3),
            kinematics=PlaneStrain(),
            material=material,
            supports=[Roller("bottom", "y"), Roller("left", "x")],
            baths=[Bath("top", c=4.0, P=0.0, treatment=Penalty(relative=1e3))],
            initial=(4.0, 0.0),
            loads=[Traction("top", (0.0, -0.05 * stress))],
            charge=Ramp((0, 1e-9)),
        )
        result = scene.run(10.0, Fixed(5.0))
        counts.append([step.iterations for step in result.steps])
        ends.append(scene.problem.vector[scene.problem.ranges["u"]].copy())
    assert counts[0] == counts[1]
    assert ends[0] == pytest.approx(ends[1], rel=1e-6, abs=1e-9)
