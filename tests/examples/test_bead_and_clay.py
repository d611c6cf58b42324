"""A microgel bead and clay between aquifers, each a file of at most 40 lines, against closed forms and finer runs."""

from dataclasses import replace
from math import exp, pi, sin
from pathlib import Path

import pytest

from examples import clay_between_aquifers as clay
from examples import microgel_bead as bead
from ngswell import Adaptive, micrometre, year
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", ["microgel_bead", "clay_between_aquifers"])
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
