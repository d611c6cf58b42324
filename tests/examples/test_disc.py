"""The example of an intervertebral disc, by one number and what it owes to its fibres."""

from dataclasses import replace
from pathlib import Path

import pytest

from examples import disc
from ngswell import Adaptive, NeoHookean, Scene, hour


def test_it_is_short():
    assert len(Path(disc.__file__).read_text(encoding="utf-8").splitlines()) <= 40


def test_the_pressure_in_the_nucleus_by_day():
    night = disc.disc.equilibrate(0.0)
    day = disc.disc.run(16 * hour, Adaptive(2e-2), resume=night)
    # Order 3 and 16 × 8 cells change the rest at night by 2e-3, a tolerance of 1e-3 the pressure by day by 1e-5.
    assert day.state.at((1.0, 0.5), "p") == pytest.approx(0.3466, rel=2e-3)


def test_the_fibres_halve_the_bulge_of_the_annulus():
    def bulge(material):
        kept = {name: getattr(disc.disc, name) for name in ("mesh", "kinematics", "supports", "baths")}
        scene = Scene(material=material, **kept)
        return scene.state(scene.equilibrate(0.0)).at((20.0, 0.0), "displacement")[0]

    assert 0 < bulge(disc.material) < 0.55 * bulge(replace(disc.material, solid=NeoHookean()))
