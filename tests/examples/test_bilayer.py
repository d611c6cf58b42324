"""examples/bilayer.py: a strip of two gels against Timoshenko's curvature, and where it covers itself."""

from pathlib import Path

import pytest

from examples import bilayer
from ngswell import OverlapWarning
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium


def timoshenko(upper, lower):
    """3/2 Δε/h of halves of one thickness and stiffness [1/mm], S. Timoshenko, J. Opt. Soc. Am. 11 (1925) 233–255.

    Of the swollen strip: Δε = Δλ/λ, h = λ THICKNESS, with the stretches that the halves have when free.
    """
    stretches = [homogeneous_equilibrium(bilayer.gel(c), bilayer.BATH, "plane strain").J ** 0.5 for c in (upper, lower)]
    mean = sum(stretches) / 2
    return 1.5 * (stretches[0] - stretches[1]) / mean**2 / bilayer.THICKNESS


def test_a_strip_curls_away_from_the_half_that_swells_more():
    # It departs with the square of the mismatch: 1.5e-7 for 0.051 against 0.05 mol/l, 1.2e-5 for 0.06.
    assert bilayer.curvature(bilayer.curled(0.06)) == pytest.approx(-timoshenko(0.06, 0.05), rel=5e-5)
    assert bilayer.curvature(bilayer.curled(0.04)) > 0  # control: the other way
    # 40 cells along the strip: −2.294.
    assert bilayer.curvature(bilayer.curled(0.2)) == pytest.approx(-2.294, rel=5e-3)
    assert len(Path(bilayer.__file__).read_text(encoding="utf-8").splitlines()) <= 40


def test_one_that_curls_into_itself_says_so():
    with pytest.warns(OverlapWarning, match="the body overlaps itself"):
        bilayer.curled(0.3)
