"""The flow through a bath: that of the ledger, of the right sign, and of the order that derivatives at a bath lack."""

import numpy as np
import pytest

from ngswell import (
    ESDIRK4,
    TABLE_2,
    Adaptive,
    Bath,
    Concentration,
    Confined,
    DampedNewton,
    Essential,
    Fixed,
    InputError,
    Integral,
    Ledger,
    Material,
    Multiplier,
    Nitsche,
    Outflow,
    Penalty,
    Potential,
    Ramp,
    Roller,
    Scene,
    Traction,
    Uncharged,
    column,
)
from ngswell.closed_forms import consolidation
from ngswell.physics import donnan
from tests.scenes import FALLING, confined_column, quarter, strip


@pytest.mark.parametrize("motion", [confined_column, strip])
@pytest.mark.parametrize(
    ("model", "treatment"),
    [
        (Potential(3), Essential()),
        (Potential(), Penalty(relative=1e3)),
        (Concentration(), Penalty(1.0)),
        (Concentration(3), Nitsche()),
        (Concentration(), Multiplier()),
    ],
)
def test_it_is_what_the_ledger_books(model, treatment, motion):
    """Steps of backward Euler have one rate each: rate times step is what left, to round-off of the contents."""
    cells, point, width = (5, (0.5,), 1.0) if motion is confined_column else ((2, 5), (0.013, 0.5), 0.02)
    ledger, outflow = Ledger(), Outflow("top", point)
    result = motion(treatment, c=FALLING, model=model, cells=cells).run(15.0, Fixed(5.0), [ledger, outflow])
    for rate, left in ((outflow.fluid, ledger.fluid_left), (outflow.cations, ledger.cations_left)):
        assert rate[1:] * 5.0 == pytest.approx(np.diff(left["top"]), rel=1e-10)
        assert np.isnan(rate[0])
    # Uniform along the top, whose length stays: the flux at a point is the whole over the width.
    assert outflow.fluid_at[1:, 0] * width == pytest.approx(outflow.fluid[1:], rel=1e-7)
    assert outflow.cations_at[1:, 0] * width == pytest.approx(outflow.cations[1:], rel=1e-7)
    plain = result.state.at(point, "seepage")[-1] * width
    assert abs(plain / outflow.fluid[-1] - 1) > 0.03  # the control: derivatives at the bath


def test_in_steps_of_higher_order_it_is_the_slope_of_the_ledger():
    """Away from kinks differences of the ledger over 2h are off by h²/6 of the rate's second derivative."""

    def off(h):
        ledger, outflow = Ledger(), Outflow("top")
        scene = confined_column(None, c=Ramp((0, 0.15), (100, 0.125)), model=Potential(), cells=5)
        scene.run(48.0, Fixed(h, ESDIRK4), [ledger, outflow], newton=DampedNewton())
        slope = (ledger.fluid_left["top"][2:] - ledger.fluid_left["top"][:-2]) / (2 * h)
        middle = 24.0 / h  # the middle of the run
        return abs(slope[round(middle) - 1] / outflow.fluid[round(middle)] - 1)

    coarse, fine = off(4.0), off(2.0)
    assert fine < 1e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.3)


def test_the_profile_along_a_deformed_boundary_gives_the_whole():
    """∫ q da is the outflow, as the constants are among the traces; here by the trapezoidal rule over half cells."""
    points = [(x, 1.0) for x in np.linspace(0, 1, 7)] + [(1.0, y) for y in np.linspace(1, 0, 7)[1:]]
    outflow, ledger = Outflow("top|right", *points), Ledger()
    scene = quarter(cells=3, c=Ramp((0, 1.0), (100, 0.9)), charge=Ramp((0, 0.0), (100, 0.5)), model=Potential())
    result = scene.run(100.0, Fixed(50.0), [outflow, ledger])
    assert outflow.fluid[1:] * 50.0 == pytest.approx(np.diff(ledger.fluid_left["top|right"]), rel=1e-10)
    moved = np.array([np.add(point, result.state.at(point, "displacement")) for point in points])
    lengths, q = np.linalg.norm(np.diff(moved, axis=0), axis=1), outflow.fluid_at[-1]
    # q is linear between vertices; the stretch varies within a cell, by a few percent of itself.
    assert lengths @ (q[1:] + q[:-1]) / 2 == pytest.approx(outflow.fluid[-1], rel=1e-3)


def test_baths_that_meet_share_what_passes():
    """Each bath's outflow is the ledger's own, and the flux of the second misses what its shared node holds."""
    baths = [Bath("top", c=Ramp((0, 1.0), (100, 0.9))), Bath("right", c=1.0)]
    outflows, ledger = [Outflow("top", (0.5, 1.0)), Outflow("right", (1.0, 0.5))], Ledger()
    scene = quarter(cells=3, baths=baths, charge=Ramp((0, 0.0), (100, 0.5)))
    scene.run(50.0, Fixed(50.0), [*outflows, ledger])
    for outflow in outflows:
        left = ledger.fluid_left[outflow.boundary][-1]
        assert outflow.fluid[-1] * 50.0 == pytest.approx(left, rel=1e-10)
        assert np.isfinite(outflow.fluid_at[-1]).all()


def test_the_sign_where_derivatives_have_the_other():
    """Table 2 in 4.1 mol/l, bath suddenly 0.3: after 10 s fluid still leaves, by 3.166e-4 mm/s (order 3 and 4 on 40 graded
    cells and `Concentration` of order 3 on 60 agree to 4e-5), while it swells inside the first cell. On ten even cells of
    order 2 the layer is as thin as a cell: a quarter off, the error of the mesh.
    """
    p0 = donnan.pressure(4.1, TABLE_2.cfc0, TABLE_2.RT)
    outflow = Outflow("top")
    scene = confined_column(
        None, c=0.3, cells=10, model=Potential(), material=TABLE_2, initial=(4.1, 0.0), loads=[Traction("top", (-p0,))]
    )
    result = scene.run(10.0, Adaptive(1e-3), [outflow])
    assert outflow.fluid[-1] == pytest.approx(3.166e-4, rel=0.3)
    assert result.state.at((0.5,), "seepage")[0] < -1e-3  # the control


GEL = Material(mu=0.24, lam=0.16, nS0=0.25, K=1e-3)
LOAD = 1e-6 * 0.24  # departs from the linear theory by 1e-6 of the signal


def terzaghi(order, cells):
    """Relative errors of the outflow, of the seepage at the bath, and of that in the middle of the cell there."""
    time = 0.2 / consolidation.consolidation_coefficient(GEL)
    scene = Scene(
        mesh=column(1.0, cells), kinematics=Confined(), material=GEL, model=Uncharged(order=order),
        supports=[Roller("bottom", "x")], baths=[Bath("top")], loads=[Traction("top", (-LOAD,))],
    )  # fmt: skip
    outflow, end = Outflow("top"), None
    for halvings in range(10, -1, -1):  # steps that grow with the time since the load: 1.5e-5 left of the error in time
        at = time / 2**halvings
        observers = [] if halvings else [outflow]
        result = scene.run(at, Fixed(at / 8, ESDIRK4), observers, newton=DampedNewton(tolerance=1e-12), resume=end)
        end = result.end
    h = 1e-4 * time  # the closed form's differences: 1e-8
    settled = consolidation.terzaghi_settlement(GEL, LOAD, 1.0, [time + h, time - h])
    middle, dz = 1 - 0.5 / cells, 1e-4
    pressure = consolidation.terzaghi_pressure(GEL, LOAD, 1.0, [middle + dz, middle - dz], time)
    flux, inside = (settled[0] - settled[1]) / (2 * h), -1e-3 * (pressure[0] - pressure[1]) / (2 * dz)
    at = result.state.at
    found = (outflow.fluid[-1] / flux, at((1.0,), "seepage")[0] / flux, at((middle,), "seepage")[0] / inside)
    return np.abs(np.array(found) - 1)


def test_orders_on_a_column_with_a_closed_form():
    """Terzaghi's column: the outflow is of order 2k − 2 in the order k of u, seepage of order 2 (p of order 1 and 2)."""
    coarse, fine = terzaghi(2, 8), terzaghi(2, 16)
    assert coarse / fine == pytest.approx([4.0, 4.0, 4.0], rel=0.25)  # the error in time is a quarter of the finest
    assert fine[0] < 1e-4 < 1e-3 < fine[1]  # the control: derivatives at the bath
    coarse, fine = terzaghi(3, 2), terzaghi(3, 4)
    assert coarse[0] / fine[0] > 16
    assert coarse[1:] / fine[1:] == pytest.approx([4.0, 4.0], rel=0.25)
    assert fine[0] < 1e-4 < 1e-2 < fine[1]


@pytest.mark.parametrize(
    ("observer", "words"),
    [
        (lambda: Outflow("bottom"), "'bottom' is no bath's boundary.*'top'"),
        (lambda: Outflow("top", (0.01, 0.4)), "not a point of the boundary 'top'"),
        (lambda: Outflow("top", (0.01,)), "not a point of the boundary 'top'"),
        (lambda: Outflow("top", (0.01, 0.5), (0.0, 0.0)), r"\(0.0, 0.0\) is not a point"),
        (lambda: Outflow(""), "boundary"),
        (lambda: Integral("seepage", "top"), "Outflow"),
        (lambda: Integral("cation_flux", boundary="bottom"), "Outflow"),
    ],
)
def test_refused(observer, words):
    with pytest.raises(InputError, match=words):
        strip(cells=(1, 2)).run(10.0, Fixed(5.0), [observer()])
