"""Homogeneous equilibria over baths and charges, and Donnan equilibrium of gels that are not homogeneous."""

import numpy as np
import pytest

from ngswell import LocalDonnan, Potential
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.physics import laws
from studies.limits.verification import gel, homogeneous_body, printed_drive, unrest


@pytest.mark.parametrize("motion", ["confined", "plane strain", "3-d"])
@pytest.mark.parametrize("model", [None, LocalDonnan(), Potential()])
def test_over_baths_and_charges(motion, model):
    """Baths over nearly seven decades, charges from none to 1 mol/l: up to thirtyfold swelling, to Newton's tolerance."""
    largest = 0.0
    for cfc0 in (0.0, 0.01, 0.2, 1.0):
        for bath in (1e-6, 1e-3, 0.15, 5.0):
            scene = homogeneous_body(motion, cfc0, bath, model)
            state = scene.state(scene.equilibrate())
            closed = homogeneous_equilibrium(gel(cfc0), bath, motion)
            J = state.J(scene.problem.points).ravel()
            assert pytest.approx(np.full_like(J, closed.J), rel=1e-8) == J, (cfc0, bath)
            where = scene.mesh(*(0.5,) * scene.mesh.dim)
            outputs = state.outputs()
            for name, value in (("p", closed.p), ("c_plus", closed.c), ("cfc", closed.cfc), ("nS", closed.nS)):
                assert outputs[name](where) == pytest.approx(value, rel=1e-7, abs=1e-9), (name, cfc0, bath)
            largest = max(largest, closed.J)
    assert largest > {"confined": 3, "plane strain": 5, "3-d": 20}[motion]


@pytest.mark.parametrize("order", [2, 3])
def test_donnan_equilibrium_with_varying_charge_and_stiffness(order):
    """c₊ c₋ = c̄² and P = P̄ − 2 Rθ c̄ everywhere and no seepage, to the orders of p and c (k) and of their gradients."""
    coarse, fine = unrest(4, order), unrest(8, order)
    orders = np.log2(coarse / fine)
    assert orders[0] > order - 0.3
    assert orders[1] > order - 0.3
    assert orders[2] > order - 1 - 0.3
    assert fine[0] < 1e-3


def test_the_printed_drive_flows_at_rest(monkeypatch):
    """Negative control: with the factor x of (19) as printed the same gel does not come to Donnan equilibrium."""
    right = unrest(8)
    monkeypatch.setattr(laws, "transport", printed_drive)
    wrong_coarse, wrong = unrest(4), unrest(8)
    for kind in (1, 2):  # hydraulic pressure and seepage
        assert wrong[kind] > 30 * right[kind]
        assert abs(np.log2(wrong_coarse[kind] / wrong[kind])) < 0.1  # refinement does not help
