"""Gels bonded to a rigid base beside a wet side: the strain is singular at that edge, the rest of the body converges."""

import warnings

import numpy as np
import pytest

from ngswell import (
    TABLE_2,
    VTK,
    Axisymmetric,
    Concentration,
    ExtrapolationWarning,
    LocalDonnan,
    Potential,
    Probe,
    Ramp,
    StepError,
    rectangle,
)
from ngswell.errors import Reason
from ngswell.mesh.points import corners
from studies.hard_cases.bonded import on_base, square


def bonded(cells=8, grade=25.0, model=None, **changes):
    """A square of Table 1 on a rigid base, wet above and beside, with fine cells where the two meet."""
    return on_base(square(cells, grade), model or Potential(), **changes)


def rise(scene, place):
    """Displacement upwards at rest [mm]."""
    end = scene.equilibrate()
    return scene.state(end).u(scene.mesh(*place))[1]


@pytest.mark.parametrize("model", [Potential(), Potential(order=3), Concentration(), LocalDonnan()], ids=str)
def test_a_bonded_square_converges_at_its_top(model):
    """0.1993 mm: order 3 on 8 to 16 cells gives 0.19930, 0.19929, 0.19928. The singular edge costs the others a little
    more; `Concentration` has cfc smooth over its cells, which there are the ones that strain most."""
    assert rise(bonded(model=model), (0.0, 1.0)) == pytest.approx(0.1993, abs=2e-4)


def test_no_law_is_evaluated_where_the_fluid_would_be_used_up():
    """J − nS0 falls below zero at the corner, where no integration point lies: what was watched there refused the state."""
    scene = bonded()
    state = scene.state(scene.equilibrate())
    assert state.content(corners(scene.mesh)).min() < 0
    assert state.content(scene.problem.points).min() > 0.15
    assert state.J(corners(scene.mesh)).min() > 0.2


def test_outputs_at_the_corner_are_no_result_and_say_so(tmp_path):
    scene = bonded()
    probe, series = Probe((1.0, 0.0), "J"), VTK(tmp_path / "corner", "J")
    with pytest.warns(ExtrapolationWarning, match=r"at \(1, 0\) mm the fields overshoot, J − nS0 = -0\.0") as said:
        end = scene.equilibrate(observers=[probe, series])
    assert sorted(str(warning.message).partition(":")[0] for warning in said) == ["Probe", "VTK"]
    with pytest.warns(ExtrapolationWarning, match=r"state.at: at \(1, 0\) mm"):
        assert scene.state(end).at((1.0, 0.0), "nS") > 1.0
    with warnings.catch_warnings(action="error"):  # the control: elsewhere nothing is said
        scene.state(end).at((0.5, 0.5), "nS")
        scene.equilibrate(observers=[Probe((0.5, 0.5), "J")])


def test_a_run_reaches_the_same_rest():
    """The charge is raised, then the body rests: 1e6 s are 100 times its slowest time, some L²/(K µ) = 4e3 s and more."""
    scene = bonded(charge=Ramp((0.0, 0.0), (1000.0, 1.0)))
    result = scene.run(1e6)
    assert result.state.u(scene.mesh(0.0, 1.0))[1] == pytest.approx(rise(bonded(), (0.0, 1.0)), abs=1e-8)


def disc(cells, order=2):
    mesh = rectangle(1.0, 0.5, cells, cells // 2)
    return on_base(mesh, Potential(order), material=TABLE_2, kinematics=Axisymmetric())


def test_table_2_on_a_base():
    """A plain square, and a disc whose top centre is steady to a thousandth of its height over two meshes."""
    assert np.isfinite(rise(bonded(12, 1.0, material=TABLE_2), (0.0, 1.0)))
    coarse, fine = (rise(disc(cells), (0.0, 0.5)) for cells in (10, 20))
    assert fine == pytest.approx(0.269, abs=1e-3 * 0.5)
    assert coarse == pytest.approx(fine, abs=1e-3 * 0.5)


def test_overshoot_of_higher_orders_at_the_edge_is_no_fold():
    """Polynomials of order 3 take J below zero at the corner itself; the rest is as with order 2, to 1e-3 of the height."""
    scene = disc(8, order=3)
    state = scene.state(scene.equilibrate())
    assert state.J(corners(scene.mesh)).min() < 0
    assert state.J(scene.problem.points).min() > 0.6
    assert state.u(scene.mesh(0.0, 0.5))[1] == pytest.approx(0.269, abs=1e-3 * 0.5)


def test_an_edge_finer_than_its_fold_is_named():
    """With cells of 1.4 µm at the edge these fold over: nothing to do with the size of the load alone, and said so."""
    with pytest.raises(StepError, match=r"a cell would turn over.*coarser cells at that edge") as caught:
        bonded(8, 400.0).equilibrate()
    assert caught.value.reason is Reason.TURNS_OVER
    assert caught.value.cause.where == pytest.approx((1.0, 0.0), abs=2e-3)  # within the cell at the edge
    assert rise(bonded(8, 25.0), (0.0, 1.0)) > 0  # the remedy
