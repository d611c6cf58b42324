"""The hard cases of mechanics and of meshes at a small size: passed within their bounds, or ended as documented."""

import pytest

from ngswell import Adaptive, StepError
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from studies.hard_cases import mechanics
from studies.hard_cases.attempt import CHOICES, DEFAULTS, unusable


def outcomes(attempts, start=""):
    found = {(a.case, a.variant): (a.outcome, a.message) for a in attempts if a.case.startswith(start)}
    assert found
    return found


def passed(attempts, start=""):
    return {key: found for key, found in outcomes(attempts, start).items() if found[0] != "passes"} == {}


def test_baths_that_meet_at_a_corner():
    attempts = mechanics.corner(quick=True)
    assert {a.variant for a in attempts} == set(CHOICES)
    assert passed(attempts)


def test_near_the_compression_point():
    attempts = mechanics.compression(quick=True)
    assert passed(attempts, "1 % left")
    for outcome, message in outcomes(attempts, "no equilibrium").values():
        assert outcome == "stops"
        assert message.startswith("no step succeeds")


@pytest.mark.parametrize("name", DEFAULTS)
def test_at_the_limit_of_what_the_solid_bears(name):
    """µ (1 − nS0²)/nS0: at the limit the drained end would lose all its fluid at once; just below it some is left."""
    soft = mechanics.SOFT
    nS0 = soft.number("nS0")
    limit = soft.number("mu") * (1 - nS0**2) / nS0
    scene = mechanics.pressed(soft, limit, *DEFAULTS[name])
    with pytest.raises(StepError) as stopped:
        scene.run(1e4, Adaptive(1e-2), newton=mechanics.EXACT)
    assert not unusable(scene, stopped.value.time)
    assert mechanics.J_at_points(scene).min() > nS0
    scene = mechanics.pressed(soft, 0.999 * limit, *DEFAULTS[name])
    scene.run(1e6, Adaptive(1e-2), newton=mechanics.EXACT)
    rest = homogeneous_equilibrium(soft, 0.15, "confined", load=0.999 * limit).J
    assert rest - nS0 < 3e-4
    # A homogeneous state: the closed form to Newton's tolerance of the displacement, 1e-8 of the height.
    assert mechanics.J_at_points(scene) == pytest.approx(rest, abs=1e-7)


def test_large_swelling():
    assert passed(mechanics.swelling(quick=True))


def test_slender_and_distorted_cells():
    attempts = mechanics.cells(quick=True)
    unsound = {case: outcomes(attempts, case) for case in mechanics.UNSOUND}
    assert all(found[0] == "refused" for case in unsound.values() for found in case.values())
    assert all(message.startswith("mesh: cell ") for case in unsound.values() for _, message in case.values())
    assert passed([a for a in attempts if a.case not in unsound])
