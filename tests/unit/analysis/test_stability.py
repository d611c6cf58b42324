"""Growth needs a step and a state of its scene."""

from dataclasses import replace

import pytest

from ngswell import TABLE_1, Fixed, Frozen, InputError, NgswellError, Traction
from ngswell.analysis.one_step import growth_factor
from tests.scenes import confined_column, strip


def test_growth_needs_a_step_and_a_state_of_its_scene():
    with pytest.raises(InputError, match="positive"):
        growth_factor(strip(Frozen()), 0.0)
    end = confined_column().run(1.0, Fixed(1.0)).end
    with pytest.raises(InputError, match="another mesh"):
        growth_factor(strip(Frozen()), 1.0, end)
    soft = replace(TABLE_1, cfc0=0.0, lam=0.0)
    with pytest.raises(NgswellError, match="does not succeed"):  # crushed: nothing to linearise about
        growth_factor(strip(material=soft, loads=[Traction("top", (0.0, -100.0))]), 1e3)
    with pytest.raises(NgswellError, match="most_steps"):
        growth_factor(strip(Frozen()), 1e-3, most_steps=40)
