"""A ball pressed into a large body by little: Hertz's force, of the drained body and of one that lets nothing flow."""

import pytest

from ngswell import (
    Axisymmetric,
    Bath,
    Fixed,
    Material,
    Obstacle,
    Ramp,
    Reaction,
    RigidSphere,
    Roller,
    Scene,
    Uncharged,
    rectangle,
)

MU, LAM = 0.5, 0.75  # N/mm²
RADIUS, SIZE = 1.0, 3.0  # mm
CONTACT = 0.01
"""Radius of the contact [mm]: strains of CONTACT/RADIUS, and the body is 300 times as large, which stiffens it by 0.4 %."""

TOLERANCE = 0.015
"""Of the force: cells of 0.08 contact radii, whose edge cuts through one; on 14, 20 and 28 cells the drained force is off by
2.3, −0.4 and 0.7 %."""


def pressed(K):
    down = Ramp((0, 0.0), (1, -(CONTACT**2) / RADIUS))
    return Scene(
        mesh=rectangle(SIZE, SIZE, 20, 20, grade={"top": 1000, "left": 1000}), kinematics=Axisymmetric(),
        material=Material(mu=MU, lam=LAM, nS0=0.2, K=K), model=Uncharged(),
        supports=[Roller("left", "r"), Roller("bottom", "rz")], baths=[Bath("right|bottom")],
        loads=[Obstacle("top", RigidSphere((0.0, SIZE + RADIUS), RADIUS), (0.0, down))],
    )  # fmt: skip


def hertz(modulus):
    """4/3 E/(1 − ν²) R^½ δ^(3/2) [N], H. Hertz, J. reine angew. Math. 92 (1882) 156–171."""
    return 4 / 3 * modulus * CONTACT**3 / RADIUS


def test_a_drained_body():
    ball = Reaction("top")
    pressed(1e-3).equilibrate(1.0, observers=[ball])
    force, drained = ball.values[-1][1], hertz(4 * MU * (LAM + MU) / (LAM + 2 * MU))
    assert force == pytest.approx(drained, rel=TOLERANCE)
    assert force < 0.8 * hertz(4 * MU)  # control: the other limit is 1.4 times that


def test_a_body_that_lets_nothing_flow():
    ball = Reaction("top")
    # √(K (2µ + λ) 1 s) is a thousandth of the contact; without flow one step is exact.
    pressed(1e-10).run(1.0, Fixed(1.0), [ball])
    assert ball.values[-1][1] == pytest.approx(hertz(4 * MU), rel=TOLERANCE)  # ν = 1/2
