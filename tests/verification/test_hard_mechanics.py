"""The hard cases of mechanics and of meshes at a small size: passed within their bounds, or ended as documented."""

import numpy as np
import pytest

from ngswell import Adaptive, StepError
from studies import hard_mechanics
from studies.hard import CHOICES, DEFAULTS, unusable


def outcomes(attempts, start=""):
    found = {(a.case, a.variant): (a.outcome, a.message) for a in attempts if a.case.startswith(start)}
    assert found
    return found


def passed(attempts, start=""):
    return {key: found for key, found in outcomes(attempts, start).items() if found[0] != "passes"} == {}


def test_baths_that_meet_at_a_corner():
    attempts = hard_mechanics.corner(quick=True)
    assert {a.variant for a in attempts} == set(CHOICES)
    assert passed(attempts)


def test_near_the_compression_point():
    attempts = hard_mechanics.compression(quick=True)
    assert passed(attempts, "1 % left")
    for outcome, message in outcomes(attempts, "no equilibrium").values():
        assert outcome == "stops"
        assert message.startswith("no step succeeds")


@pytest.mark.parametrize("name", DEFAULTS)
def test_at_the_limit_of_what_the_solid_bears(name):
    """µ (1 − nS0²)/nS0: the content falls towards zero until round-off decides, and stays positive in the last state."""
    soft = hard_mechanics.SOFT
    nS0 = soft.number("nS0")
    scene = hard_mechanics.pressed(soft, soft.number("mu") * (1 - nS0**2) / nS0, *DEFAULTS[name])
    with pytest.raises(StepError) as stopped:
        scene.run(1e4, Adaptive(1e-2), newton=hard_mechanics.EXACT)
    assert not unusable(scene, stopped.value.time)
    J = hard_mechanics.J_at_points(scene)
    assert nS0 < J.min() < nS0 + 1e-2
    assert np.isfinite(scene.problem.vector).all()


def test_large_swelling():
    assert passed(hard_mechanics.swelling(quick=True))


def test_slender_and_distorted_cells():
    attempts = hard_mechanics.cells(quick=True)
    unsound = {case: outcomes(attempts, case) for case in hard_mechanics.UNSOUND}
    assert all(found[0] == "refused" for case in unsound.values() for found in case.values())
    assert all(message.startswith("mesh: cell ") for case in unsound.values() for _, message in case.values())
    assert passed([a for a in attempts if a.case not in unsound])
