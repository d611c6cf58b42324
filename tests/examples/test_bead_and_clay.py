"""A microgel bead, clay between aquifers and a borehole, in at most 40 lines each, against closed forms and finer runs."""

from dataclasses import replace
from math import exp, pi, sin, sqrt
from pathlib import Path

import pytest

from examples import borehole
from examples import clay_between_aquifers as clay
from examples import microgel_bead as bead
from ngswell import Adaptive, micrometre, year
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", ["microgel_bead", "clay_between_aquifers", "borehole"])
def test_they_fit_a_screen(name):
    assert len((EXAMPLES / f"{name}.py").read_text(encoding="utf-8").splitlines()) <= 40


def test_a_bead_comes_to_its_closed_form():
    time, radius = bead.swelling()
    before, after = (
        50 * micrometre * homogeneous_equilibrium(bead.GEL, c, "3-d").J ** (1 / 3) for c in (bead.BEFORE, bead.AFTER)
    )
    assert radius[0] == pytest.approx(before, rel=1e-9)
    assert radius[-1] == pytest.approx(after, rel=3e-4)  # Adaptive(1e-4): at most three times that of the change
    assert (len(time), time[-1]) == (401, 20.0)


def test_small_beads_are_faster_with_the_square_of_their_size():
    large, small = (bead.half_time(*bead.swelling(radius * micrometre)) for radius in (50, 5))
    assert large == pytest.approx(1.0, abs=0.05)  # s, to a record
    assert large / small == pytest.approx(100, rel=1e-6)  # nothing else has a length or a time


def test_clay_starts_at_rest_and_ends_as_on_a_finer_mesh(monkeypatch):
    years, anions, heave = clay.history(clay.scene())
    rest = homogeneous_equilibrium(clay.SWELLING, clay.SEA, "confined")
    assert anions[0] == pytest.approx(rest.c - rest.cfc, rel=1e-9)
    assert (len(years), years[-1]) == (101, pytest.approx(1e6))
    assert heave[-1] - heave[0] == pytest.approx(126, abs=1)  # mm
    column = clay.column
    monkeypatch.setattr(clay, "column", lambda height, cells, **how: column(height, 2 * cells, **how))
    monkeypatch.setattr(clay, "Adaptive", lambda tolerance: Adaptive(tolerance / 100))
    _, finer, higher = clay.history(clay.scene())
    assert anions == pytest.approx(finer, abs=3e-4 * clay.SEA)  # the tolerance
    assert heave == pytest.approx(higher, abs=3e-4 * (higher[-1] - higher[0]))


def test_salt_alone_diffuses_by_its_series():
    """Without charge, one clay: a slab whose top falls at once, half of the ramp later."""
    plain = replace(clay.STIFF, cfc0=0.0)
    _, anions, _ = clay.history(clay.scene(plain, plain), 2e5 * year)
    D = 2 * 1.5e-5 * 2e-5 / 3.5e-5
    place, fallen = 32.5 / 40, []
    for number in (5, 10, 20):
        T = D * (number * 1e4 - 500) * year / clay.HEIGHT**2
        series = sum(2 * (-1) ** n / (n * pi) * sin(n * pi * place) * exp(-((n * pi) ** 2) * T) for n in range(1, 40))
        fallen.append((clay.SEA - anions[number]) / (clay.SEA - clay.FRESH) - (place + series))
    assert fallen == pytest.approx([0.0] * 3, abs=1e-3)  # the ramp's second moment (1e-4) and the mesh


def test_a_borehole_by_the_closed_forms_of_small_strain():
    m, drop, a, b = borehole.CLAY, 0.01 * borehole.ROCK, borehole.WALL, borehole.FAR
    mu, charge, salt = m.number("mu"), m.number("cfc0"), borehole.SALT
    inwards, hoop = borehole.wall(borehole.borehole(drop=drop))
    # Lamé's tube: sheared around the hole, drained and undrained alike but for a²/b² = 4e-4; strains of 1e-4 are left.
    lame = drop * a / (2 * mu) / (1 - (a / b) ** 2)
    assert [inwards[1], inwards[-1]] == pytest.approx([lame, lame], rel=2e-4)
    assert hoop[[0, -1]] == pytest.approx([-borehole.ROCK, -borehole.ROCK - drop], rel=1e-4)
    # Mud of 2 % less salt: the swollen wall is held around by the rest. −2µ/(2µ + λ′) of what the osmotic pressure rises by,
    # λ′ = λ + Rθ cfc²/(nF sqrt(cfc² + 4c̄²)) with the stiffness that the charge brings; second order in the change is left.
    mud = 0.98 * salt
    moved, loaded = borehole.wall(borehole.borehole(mud, drop))
    osmotic = 2 * m.RT * ((sqrt(mud**2 + charge**2 / 4) - mud) - (sqrt(salt**2 + charge**2 / 4) - salt))
    stiff = m.number("lam") + m.RT * charge**2 / ((1 - m.number("nS0")) * sqrt(charge**2 + 4 * salt**2))
    assert loaded[-1] - hoop[-1] == pytest.approx(-2 * mu / (2 * mu + stiff) * osmotic, rel=2e-3)
    assert abs(moved[-1] / inwards[-1] - 1) < 1e-4
