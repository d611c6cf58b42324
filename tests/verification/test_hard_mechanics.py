"""A hard case of mechanics: at the limit of what the solid bears. The others are those of tests/studies."""

import numpy as np
import pytest

from ngswell import Adaptive, StepError
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.mesh.points import points
from studies.hard_cases.attempt import DEFAULTS
from studies.hard_cases.bodies import ACCURATE
from studies.hard_cases.compression import SOFT, pressed


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
