"""Numbers that are each possible but hardly belong together are said once, with both; real bodies pass without a word."""

import warnings
from dataclasses import replace

import pytest

from ngswell import (
    TABLE_1,
    TABLE_2,
    Bath,
    Confined,
    Fixed,
    Material,
    Roller,
    Scene,
    Traction,
    Uncharged,
    UnitsWarning,
    column,
    metre,
    micrometre,
)
from tests.scenes import WITHOUT_IONS

CARTILAGE = Material(mu=0.2, lam=0.1, nS0=0.2, cfc0=0.2, D_plus=5e-4, D_minus=8e-4, K=1e-3)
CLAY = Material(mu=50.0, lam=80.0, nS0=0.6, cfc0=0.3, D_plus=2e-5, D_minus=2e-5, K=1e-7)  # kF = 1e-15 m/s
BENTONITE = Material(mu=3.0, lam=5.0, nS0=0.5, cfc0=2.0, D_plus=1e-4, D_minus=1e-5, K=1e-7)
MICROGEL = Material(mu=5e-3, lam=0.0, nS0=0.05, cfc0=0.05, D_plus=1e-3, D_minus=1.5e-3, K=1e-2)
SOFT_POROUS = Material(mu=1e-3, lam=0.0, nS0=0.02, K=10.0)  # a cryogel


def made(material, height):
    charged = material.D_plus is not None
    return Scene(
        mesh=column(height, 2), kinematics=Confined(), material=material, supports=[Roller("bottom", "x")],
        baths=[Bath("top", c=0.15 if charged else None)], **({} if charged else {"model": Uncharged()}),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("material", "height"),
    [
        (TABLE_1, 0.5), (TABLE_2, 1.0), (CARTILAGE, 2.0), (CARTILAGE, 0.05), (CLAY, 0.1 * metre), (CLAY, 1e3 * metre),
        (CLAY, 20.0), (BENTONITE, 10.0), (MICROGEL, 5 * micrometre), (SOFT_POROUS, 5.0), (WITHOUT_IONS, 1.0),
    ],
)  # fmt: skip
def test_real_bodies_pass_without_a_word(material, height):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made(material, height)


@pytest.mark.parametrize(
    ("material", "height", "words"),
    [
        (replace(CARTILAGE, mu=5e3), 1.0, r"Rθ cfc0 = 0.5 N/mm² on a solid of 2µ \+ λ = 1e\+04 .* in MPa"),
        (replace(CARTILAGE, mu=5e3, cfc0=0.0), 1.0, r"within .* = 0.1 s, salt within .* = 2e\+03 s, 2e\+04 times"),
        (replace(TABLE_1, K=1.07e-11), 1.0, "1e-08 times as long"),  # a kF in m/s
        (replace(TABLE_1, K=1e3), 1.0, "K in mm⁴"),
        (TABLE_1, 1e-3, r"0.001 mm = 1 µm large: fluid passes it within .* = 0.0019 s, salt within .* = 0.002 s.*in metres"),
        (WITHOUT_IONS, 1e-3, "in metres"),
        (replace(TABLE_1, cfc0=1e-6), 1.0, "is cfc0 in mol/l"),
    ],
)
def test_what_hardly_belongs_together_is_said(material, height, words):
    with pytest.warns(UnitsWarning, match=words):
        made(material, height)


def test_it_is_said_once():
    with pytest.warns(UnitsWarning) as told:
        scene = made(TABLE_1, 1e-3)
    assert len(told) == 1
    assert told[0].filename == __file__
    scene.after(scene.run(2e-3, Fixed(1e-3)), loads=[Traction("top", (-1e-3,))])  # a warning would be an error
