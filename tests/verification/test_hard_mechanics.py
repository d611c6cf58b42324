"""The hard cases of mechanics and of meshes at a small size: passed within their bounds, or ended as documented."""

import numpy as np
import pytest

from ngswell import Adaptive, StepError
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.mesh.points import points
from studies.hard_cases.attempt import CHOICES, DEFAULTS
from studies.hard_cases.bodies import ACCURATE
from studies.hard_cases.cells import UNSOUND, cells
from studies.hard_cases.compression import SOFT, compression, pressed
from studies.hard_cases.corner import corner
from studies.hard_cases.swelling import swelling


def outcomes(attempts, start=""):
    found = {(a.case, a.variant): (a.outcome, a.message) for a in attempts if a.case.startswith(start)}
    assert found
    return found


def passed(attempts, start=""):
    return {key: found for key, found in outcomes(attempts, start).items() if found[0] != "passes"} == {}


def test_baths_that_meet_at_a_corner():
    attempts = corner(quick=True)
    assert {a.variant for a in attempts} == set(CHOICES)
    assert passed(attempts)


def test_near_the_compression_point():
    attempts = compression(quick=True)
    assert passed(attempts, "1 % left")
    for outcome, message in outcomes(attempts, "no equilibrium").values():
        assert outcome == "stops"
        assert message.startswith(("no step succeeds", "equilibrate finds no state of rest"))


@pytest.mark.parametrize("name", DEFAULTS)
def test_at_the_limit_of_what_the_solid_bears(name):
    """µ (1 − nS0²)/nS0: at the limit the drained end would lose all its fluid at once; just below it some is left."""
    soft = SOFT
    nS0 = soft.number("nS0")
    limit = soft.number("mu") * (1 - nS0**2) / nS0
    scene = pressed(soft, limit, *DEFAULTS[name])
    with pytest.raises(StepError) as stopped:
        scene.run(1e4, Adaptive(1e-2), newton=ACCURATE)
    left = stopped.value.end
    assert left.time == stopped.value.time
    assert np.isfinite(left.values).all()
    scene.problem.restore(left)
    assert scene.problem.admissible.violation() is None
    where = points(scene.mesh, order=4)
    assert scene.state(left).J(where).min() > nS0
    scene = pressed(soft, 0.999 * limit, *DEFAULTS[name])
    end = scene.run(1e6, Adaptive(1e-2), newton=ACCURATE).state
    rest = homogeneous_equilibrium(soft, 0.15, "confined", load=0.999 * limit).J
    assert rest - nS0 < 3e-4
    # A homogeneous state: the closed form to Newton's tolerance of the displacement, 1e-8 of the height.
    assert end.J(points(scene.mesh, order=4)).ravel() == pytest.approx(rest, abs=1e-7)


def test_large_swelling():
    assert passed(swelling(quick=True))


def test_slender_and_distorted_cells():
    attempts = cells(quick=True)
    unsound = {case: outcomes(attempts, case) for case in UNSOUND}
    assert all(found[0] == "refused" for case in unsound.values() for found in case.values())
    assert all(message.startswith("mesh: cell ") for case in unsound.values() for _, message in case.values())
    assert passed([a for a in attempts if a.case not in unsound])
