"""Predicted against observed growth of lagged baths, with and without the remedies that the paper lists."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import CF, x, y

from ngswell import (
    TABLE_1,
    Averaged,
    Concentration,
    DampedNewton,
    Fixed,
    Frozen,
    InnerLayer,
    Lagged,
    LeastSquares,
    NgswellError,
    Penalty,
    Probe,
    Ramp,
    Traction,
)
from ngswell.analysis.one_step import growth_factor, leading_eigenvalues
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium, lagged_column_factor
from ngswell.physics import donnan
from ngswell.setup.snapshot import Snapshot
from studies.paper.oscillation import measured_growth
from studies.scenes import disturbed
from tests.scenes import confined_column, quarter, strip

SOFT = replace(TABLE_1, mu=0.06)
"""Here the dead load p0 exceeds µ and the strip would buckle, faster than steps of 0.1 s and more can resolve: backward
Euler damps that, and what grows is the column's mode of the lagged boundary."""
SHARP = DampedNewton(tolerance=1e-12)  # disturbances of 1e-6 have to be converged, too

ROUND_OFF_TO_NONLINEAR = 2e-3
"""Relative accuracy of an observed factor: some ten steps between round-off and the first effect of nonlinearity, over which
the next mode still fades."""


def loaded(treatment, material=TABLE_1, build=strip, **changes):
    """A strip or column of any material, at rest in its reference configuration under its own p0."""
    p0 = donnan.pressure(0.15, material.cfc0, material.RT)
    load = (-p0,) if build is confined_column else (0.0, -p0)
    return build(treatment, material=material, loads=[Traction("top", load)], **changes)


def block(treatment, material=TABLE_1, cells=4):
    """A quarter of a block, the bath on its two free sides."""
    return quarter(treatment, cells=cells, material=material, model=Concentration())


def swollen(scene):
    """The homogeneous state at rest, in closed form."""
    problem, rest = scene.problem, homogeneous_equilibrium(scene.material, 0.15, "plane strain")
    problem.initialise()
    problem.fields.components[0].Set((rest.J**0.5 - 1) * CF((x, y)))
    for name, value in (("p", rest.p), ("c", rest.c), ("cfc", rest.cfc)):
        problem.vector[problem.ranges[name]] = value
    return problem.snapshot(0.0)


def observed(scene, dt, predicted, node=(0.0, 0.5), state=None):
    """Growth per step of a disturbance of round-off size, at the node's last displacement component.

    The run ends where the predicted growth has made 1e-7 mm of 1e-16 mm: what follows is no longer linear, and may fail.
    """
    steps = int(np.log(1e9) / np.log(abs(predicted)))
    probe = Probe(node, "displacement")
    start = disturbed(scene)
    if state is not None:
        start = Snapshot(start.time, start.values - scene.problem.initial + state.values)
    scene.run(steps * dt, Fixed(dt), [probe], resume=start)
    values = probe.values["displacement"].reshape(steps + 1, -1)[:, -1]
    return measured_growth(values - (0.0 if state is None else values[0]))


MATERIALS = {
    "Table 1": TABLE_1,
    "stiffer, more permeable": replace(TABLE_1, mu=0.3, K=1.07e-2),
    "less charge, softer, less permeable": replace(TABLE_1, mu=0.12, cfc0=0.12, K=1.07e-4),
    "the column grows, too": SOFT,
}


@pytest.mark.parametrize("dt", [0.1, 10.0])
@pytest.mark.parametrize("name", MATERIALS)
def test_lagged_strip_grows_as_predicted(name, dt):
    scene = loaded(Lagged(), MATERIALS[name])
    predicted = growth_factor(scene, dt).factor
    assert abs(predicted) > 1.3  # something to observe
    assert observed(scene, dt, predicted) == pytest.approx(predicted, rel=ROUND_OFF_TO_NONLINEAR)
    # Control: the growth of a material a tenth stiffer is another one.
    stiffer = replace(scene.material, mu=1.1 * scene.material.mu)
    assert growth_factor(loaded(Lagged(), stiffer), dt).factor != pytest.approx(predicted, rel=0.02)


@pytest.mark.parametrize("dt", [0.1, 10.0])
def test_a_soft_column_grows_by_its_closed_form(dt):
    factor = lagged_column_factor(SOFT, 0.15)
    assert factor < -2
    for rule in (None, Averaged(), LeastSquares(), LeastSquares(2)):  # one boundary vertex: nothing to average or fit
        scene = loaded(Lagged(rule), SOFT, confined_column)
        # The closed form is that of p at the end as it is prescribed; the rest of the column follows: no mesh error.
        assert growth_factor(scene, dt).factor == pytest.approx(factor, rel=1e-5)
    assert observed(scene, dt, factor, (0.5,)) == pytest.approx(factor, rel=ROUND_OFF_TO_NONLINEAR)


REMEDIES = {
    # What each remedy leaves: on the soft strip the column's mode, on wider ones shorter lateral modes.
    "inner layer, soft": (InnerLayer(), SOFT, 1),
    "averaged, soft": (Averaged(), SOFT, 1),
    "constant fit, soft": (LeastSquares(), SOFT, 1),
    "averaged, 2 cells across": (Averaged(), TABLE_1, 2),
    "averaged, 4 cells across": (Averaged(), TABLE_1, 4),
    "linear fit, 4 cells across": (LeastSquares(1), TABLE_1, 4),
}


@pytest.mark.parametrize("name", REMEDIES)
def test_remedies_grow_as_predicted(name):
    rule, material, across = REMEDIES[name]
    scene = loaded(Lagged(rule), material, cells=(across, 30))
    predicted = growth_factor(scene, 10.0).factor
    assert predicted < -1.5
    assert observed(scene, 10.0, predicted) == pytest.approx(predicted, rel=ROUND_OFF_TO_NONLINEAR)


@pytest.mark.parametrize("rule", [InnerLayer(), Averaged(), LeastSquares()])
def test_where_a_remedy_is_predicted_stable_a_disturbance_stays_bounded(rule):
    scene, steps = loaded(Lagged(rule)), 60
    assert 0 < growth_factor(scene, 10.0).factor < 1
    probe = Probe((0.0, 0.5), "displacement")
    scene.run(steps * 10.0, Fixed(10.0), [probe], resume=disturbed(scene))
    # Round-off of every step, 1e-16 of 0.5 mm, adds up; where the treatment grows, 3^60 would have made 1e28 of it.
    assert np.abs(probe.values["displacement"]).max() < steps * 1e-16
    control = Probe((0.0, 0.5), "displacement")
    lagged = loaded(Lagged())
    lagged.run(steps * 10.0, Fixed(10.0), [control], resume=disturbed(lagged))
    assert np.abs(control.values["displacement"]).max() > 1e-5


CASES = {
    "strip, lagged": (lambda: loaded(Lagged()), None),
    "strip, inner layer": (lambda: loaded(Lagged(InnerLayer())), None),
    "strip, averaged": (lambda: loaded(Lagged(Averaged())), None),
    "strip, constant fit": (lambda: loaded(Lagged(LeastSquares())), None),
    "strip, frozen": (lambda: loaded(Frozen()), None),
    "strip, weak": (lambda: loaded(Penalty(1.0)), None),
    "soft column, inner layer": (lambda: loaded(Lagged(InnerLayer()), SOFT, confined_column), None),
    "swollen block, lagged": (lambda: block(Lagged()), swollen),
    "soft swollen block, lagged": (lambda: block(Lagged(), SOFT), swollen),
    "soft swollen block, inner layer": (lambda: block(Lagged(InnerLayer()), SOFT), swollen),
    "soft swollen block, averaged": (lambda: block(Lagged(Averaged()), SOFT), swollen),
    "soft swollen block, quadratic fit": (lambda: block(Lagged(LeastSquares(2)), SOFT), swollen),
}


@pytest.mark.parametrize("name", CASES)
def test_a_step_multiplies_the_mode_by_the_factor(name):
    """Decaying and growing ones alike: the state after one step of a run from rest + 1e-6 mode."""
    build, state = CASES[name]
    scene, dt = build(), 10.0
    growth = growth_factor(scene, dt, None if state is None else state(scene), tolerance=1e-9)
    rest = _rest(scene, state)
    mode = growth.mode.vec.FV().NumPy()
    ends = [scene.run(dt, Fixed(dt), newton=SHARP, resume=Snapshot(0.0, rest.values + e * mode)).end for e in (1e-6, -1e-6)]
    image = (ends[0].values - ends[1].values) / 2e-6  # the difference removes the second order
    scale = _scale(scene.problem)
    # 1e-12 of Newton's method over 1e-6 of the disturbance.
    assert np.abs((image - growth.factor * mode) / scale).max() < 1e-5 * abs(growth.factor)


def _rest(scene, state):
    if state is not None:
        return state(scene)
    scene.problem.initialise()
    return scene.problem.snapshot(0.0)


def _scale(problem):
    return np.concatenate([np.full(r.stop - r.start, problem.references[n]) for n, r in problem.ranges.items()])


def test_a_state_on_its_way():
    """Half-way down a ramp of the bath nothing is at rest; the factor is still that of neighbouring runs."""
    scene = strip(Lagged(), c=Ramp((0, 0.15), (10, 0.05)))
    state = scene.run(5.0, Fixed(1.0)).end
    growth = growth_factor(scene, 1.0, state, tolerance=1e-9)
    mode = growth.mode.vec.FV().NumPy()
    ends = [
        scene.run(6.0, Fixed(1.0), newton=SHARP, resume=Snapshot(5.0, state.values + e * mode)).end for e in (1e-6, -1e-6)
    ]
    image = (ends[0].values - ends[1].values) / 2e-6
    assert np.abs((image - growth.factor * mode) / _scale(scene.problem)).max() < 1e-5 * abs(growth.factor)
    # Control: the reference state's factor is not this one.
    assert growth_factor(scene, 1.0).factor != pytest.approx(growth.factor, rel=0.05)


def test_swollen_block_grows_as_predicted():
    scene = block(Lagged(), SOFT)
    rest = swollen(scene)
    predicted = growth_factor(scene, 10.0, rest).factor
    assert predicted < -1.5
    # The second mode, that of the two sides against each other, lies 0.5 % below: it has not faded when the run ends.
    assert observed(scene, 10.0, predicted, (1.0, 1.0), rest) == pytest.approx(predicted, rel=5e-3)


def test_the_growing_mode_of_the_strip_is_lateral():
    scene = strip(Lagged())
    displacement = growth_factor(scene, 10.0).mode.components[0]
    left, right = (displacement(scene.mesh(at, 0.5))[1] for at in (0.0, 0.02))
    assert left == pytest.approx(-right, rel=1e-4)  # antisymmetric, to the tolerance of the mode
    assert abs(displacement(scene.mesh(0.0, 0.25))[1]) < 1e-3 * abs(left)  # and at the surface


def test_fields_and_clock_stay():
    scene = strip(Lagged(Averaged()), c=Ramp((0, 0.15), (10, 0.125)), charge=Ramp((0, 1.0), (10, 0.9)))
    result, point = scene.run(5.0, Fixed(5.0)), scene.mesh(0.01, 0.4)
    end, problem = result.end, scene.problem
    problem.initialise()
    started = problem.state.pointwise_charge(point)
    problem.restore(end)
    kept, charge = end.values.copy(), problem.state.pointwise_charge(point)
    assert charge != pytest.approx(started, rel=1e-3)  # something to stay
    assert result.state.pointwise_charge(point) == charge
    for state in (None, end):
        growth_factor(scene, 1.0, state)
        assert problem.time == end.time == 5.0
        assert (problem.vector == kept).all()
        assert (end.values == kept).all()
        assert problem.state.pointwise_charge(point) == charge
        assert result.state.pointwise_charge(point) == charge


def with_eigenvalues(blocks, size=200):
    """A full non-symmetric matrix with the leading `blocks` on the diagonal of its block form, the others below 0.5."""
    rng = np.random.default_rng(3)
    matrix = np.diag(rng.uniform(-0.5, 0.5, size)) + np.triu(0.01 * rng.standard_normal((size, size)), 8)
    k = 0
    for part in blocks:
        part = np.atleast_2d(part)
        matrix[k : k + len(part), k : k + len(part)] = part
        k += len(part)
    turn = np.linalg.qr(rng.standard_normal((size, size)))[0]
    return turn @ matrix @ turn.T


@pytest.mark.parametrize(
    ("blocks", "wanted"),
    [
        ([-3.0, 1.0], [-3.0]),
        ([[[1.0, -2.0], [2.0, 1.0]], 0.9], [1 + 2j, 1 - 2j]),  # a pair
        ([0.999, 0.998, 0.997, 0.996, 0.995], [0.999]),  # a cluster, as of slow diffusion in small steps
        ([1.5, -1.5], [1.5, -1.5]),
    ],
)
def test_leading_eigenvalues_of_a_known_matrix(blocks, wanted):
    A = with_eigenvalues(blocks)
    values, vector = leading_eigenvalues(lambda v: A @ v, len(A), 1e-8)
    # The matrices are close to normal: an eigenvalue's error is that of its residual, at most a few times.
    assert sorted(values[: len(wanted)], key=str) == pytest.approx(sorted(wanted, key=str), rel=1e-7)
    assert np.abs(A @ vector - values[0] * vector).max() < 1e-7


def test_no_dominant_eigenvalue_is_said():
    # A cyclic shift: two hundred eigenvalues on the unit circle, none of them leads.
    with pytest.raises(NgswellError, match="no dominant mode after"):
        leading_eigenvalues(lambda v: np.roll(v, 1), 200, most_steps=300)
    with pytest.raises(NgswellError, match="forgets"):
        leading_eigenvalues(lambda v: 0 * v, 200)
