"""Growth of the lagged scheme, failure of the printed sign, orders in time, robustness of fast swelling."""

import numpy as np
import pytest
from ngsolve import CF, y

from ngswell import (
    BACKWARD_EULER,
    TABLE_1,
    TABLE_2,
    Adaptive,
    Bath,
    Concentration,
    Fixed,
    Lagged,
    Material,
    Penalty,
    PlaneStrain,
    Potential,
    Probe,
    Roller,
    Scene,
    StepError,
    Traction,
    rectangle,
)
from ngswell.analysis.one_step import growth_factor
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium, lagged_column_factor
from ngswell.models.concentration import State
from studies.paper.oscillation import measured_growth
from studies.scenes import disturbed
from tests.scenes import FALLING, P0, confined_column, strip


@pytest.mark.parametrize("dt", [0.1, 10.0])
def test_lagged_strip_grows_as_predicted(dt):
    scene = strip(Lagged())
    probe = Probe((0.0, 0.5), "displacement")
    scene.run(24 * dt, Fixed(dt), [probe], resume=disturbed(scene))
    measured = measured_growth(probe.values["displacement"][:, 1])
    assert measured < -2  # it must grow, and alternate
    assert measured == pytest.approx(growth_factor(scene, dt).factor, rel=5e-3)


def test_weak_strip_forgets_a_disturbance():
    scene = strip(Penalty(1.0))
    assert 0 < growth_factor(scene, 10.0).factor < 1


def test_lagged_column_follows_its_closed_form():
    # The end's J after a small load step: a geometric sequence with the factor of the closed form.
    load = [Traction("top", (-P0 * (1 + 1e-7),))]
    probe = Probe((0.5,), "J")
    confined_column(Lagged(), loads=load).run(5.0, Fixed(1.0), [probe])
    change = np.diff(probe.values["J"])
    factor = lagged_column_factor(TABLE_1, 0.15)
    assert factor == pytest.approx(-0.7330, abs=5e-5)
    assert change[1:3] / change[:2] == pytest.approx([factor, factor], rel=1e-4)


def test_a_soft_lagged_column_grows():
    # Closed form beyond −1: even one dimension does not save the lagged scheme.
    soft = Material(mu=0.12, lam=0.02, nS0=0.25, cfc0=0.2, D_plus=5e-4, D_minus=8e-4, K=1.07e-3)
    factor = lagged_column_factor(soft, 0.15)
    assert factor < -1
    assert growth_factor(confined_column(Lagged(), material=soft), 1.0).factor == pytest.approx(factor, rel=1e-3)


class PrintedPenalty(Penalty):
    """The third terms of (27) and (32) on the side on which they are printed."""

    def factors(self, contact):
        for_p, for_c = super().factors(contact)
        return -for_p, -for_c


def test_the_printed_sign_fails():
    # Anti-coercive: perturbations of the boundary grow at a rate of ε/h. Steps beyond twice its inverse hide that
    # (backward Euler damps what it does not resolve), smaller ones run away.
    assert abs(growth_factor(confined_column(PrintedPenalty(1.0)), 4e-3).factor) > 2
    with pytest.raises(StepError) as caught:
        confined_column(PrintedPenalty(1.0), c=FALLING).run(1.0, Fixed(4e-3))
    assert caught.value.time < 0.5
    assert len(confined_column(c=FALLING).run(0.5, Fixed(4e-3)).steps) == 125  # the well-posed sign does not mind


def end_displacement(dt):
    probe = Probe((0.25,), "displacement", "p", "c_plus")
    confined_column(c=FALLING, cells=10).run(40.0, Fixed(dt), [probe])
    return np.array([probe.values["displacement"][-1], probe.values["p"][-1], probe.values["c_plus"][-1]])


def test_backward_euler_is_of_first_order_across_the_kink():
    coarse, middle, fine = (end_displacement(dt) for dt in (1.0, 0.5, 0.25))
    order = np.log2(np.abs(coarse - middle) / np.abs(middle - fine))
    assert order == pytest.approx(np.ones(3), abs=0.15)


def test_a_smaller_tolerance_of_backward_euler_is_a_smaller_error():
    def end(tolerance):
        probe = Probe((0.5,), "displacement")
        result = confined_column(c=FALLING, cells=10).run(200.0, Adaptive(tolerance, scheme=BACKWARD_EULER), [probe])
        return probe.values["displacement"][-1], len(result.steps)

    reference, _ = end(1e-5)
    (loose, few), (tight, many) = ((abs(value / reference - 1), steps) for value, steps in map(end, (1e-2, 1e-3)))
    # A local error of second order and a global one of first: both go with the root of the tolerance.
    assert 2 < loose / tight < 6
    assert 2 < many / few < 4
    assert tight < 1e-2


@pytest.mark.parametrize("order", [2, 3])
def test_confined_transient_converges_in_space(order):
    # The top's displacement in the middle of the transient: at least order k − 1 + 1 of the flow fields.
    def top(cells):
        probe = Probe((0.5,), "displacement")
        scene = confined_column(Penalty(relative=1e6), c=FALLING, cells=cells, model=Concentration(order=order))
        scene.run(50.0, Fixed(5.0), [probe])
        return probe.values["displacement"][-1]

    coarse, middle, fine = (top(cells) for cells in (10, 20, 40))
    assert np.log2(abs(coarse - middle) / abs(middle - fine)) > order - 0.3


def undrained_stiffness(cells):
    """Smallest eigenvalue of the momentum's tangent on displacements that move no fluid as far as p can see.

    A gel confined sideways, homogeneously swollen in 0.3 mol/l: what happens within a very short step.
    """
    scene = Scene(
        mesh=rectangle(1.0, 1.0, cells, cells),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        model=Concentration(),
        supports=[Roller("left|right", "x"), Roller("bottom", "y")],
        baths=[Bath("top", c=0.3)],
    )
    swollen = homogeneous_equilibrium(TABLE_2, 0.3, "confined")
    problem = scene.problem
    problem.initialise()
    problem.fields.components[0].Set((0 * y, (swollen.J - 1) * y))
    for name, value in (("p", swollen.p), ("c", swollen.c), ("cfc", swollen.cfc)):
        problem.vector[problem.ranges[name]] = value
    rows, columns, values = problem.linearise().COO()
    tangent = np.zeros((problem.vector.size, problem.vector.size))
    tangent[np.array(rows), np.array(columns)] = values
    free = np.array(list(problem.free))
    u = np.arange(problem.vector.size)[problem.ranges["u"]][free[problem.ranges["u"]]]
    coupling = tangent[u, problem.ranges["p"]].T
    _, sizes, directions = np.linalg.svd(coupling)
    kernel = directions[(sizes > 1e-12 * sizes[0]).sum() :].T
    return np.linalg.eigvalsh(kernel.T @ tangent[np.ix_(u, u)] @ kernel)[0]


def test_a_swollen_surface_does_not_wrinkle_early(monkeypatch):
    """The osmotic pressure of the charge at the point keeps the undrained tangent positive; the smooth p alone does not,
    and a finer mesh makes it worse: small steps through fast swelling then follow a growth that is not there."""
    assert undrained_stiffness(4) > 0
    assert undrained_stiffness(8) > 0
    monkeypatch.setattr(State, "pore_pressure", property(lambda state: state.p))
    coarse, fine = undrained_stiffness(4), undrained_stiffness(8)
    assert fine < coarse < 0


def test_confined_and_field_parameters():
    # A CoefficientFunction that is constant gives what the number gives.
    fields = Material(
        mu=CF(0.24), lam=CF(0.02), nS0=CF(0.25), cfc0=CF(0.2), D_plus=CF(5e-4), D_minus=CF(8e-4), K=CF(1.07e-3)
    )
    ends = []
    for material in (TABLE_1, fields):
        probe = Probe((0.5,), "displacement")
        scene = confined_column(c=FALLING, cells=10, material=material, model=Potential())
        scene.run(20.0, Fixed(5.0), [probe])
        ends.append(probe.values["displacement"])
    assert ends[0] == pytest.approx(ends[1], abs=1e-15)
