"""The ledger closes, for every model and treatment of the bath."""

from dataclasses import replace

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    Bath,
    Concentration,
    Essential,
    Fixed,
    Frozen,
    Lagged,
    Ledger,
    Multiplier,
    Nitsche,
    Penalty,
    Potential,
    Ramp,
    Role,
)
from tests.scenes import FALLING, confined_column, quarter, strip


@pytest.mark.parametrize("treatment", [Penalty(1.0), Penalty(relative=1e3), Frozen(), Lagged()])
@pytest.mark.parametrize("order", [2, 3])
def test_ledger_closes(treatment, order):
    # Contents and fluxes are sums over the same test functions: what is left is Newton's last quadratic remainder.
    ledger = Ledger()
    scene = confined_column(treatment, c=FALLING, model=Concentration(order=order), cells=10)
    scene.run(60.0, Fixed(5.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-11
    assert ledger.fluid_left["top"][-1] < -1e-4  # the column swells: fluid comes in
    assert np.abs(np.diff(ledger.cations)).max() > 1e-5


@pytest.mark.parametrize("motion", [confined_column, strip])
@pytest.mark.parametrize(
    ("model", "treatment"),
    [
        (Potential(), Essential()),
        (Potential(3), Essential()),
        (Potential(), Penalty(relative=1e3)),
        (Concentration(), Nitsche()),
        (Concentration(), Nitsche(0.0, "skew")),
        (Concentration(3), Nitsche(adjoint="none")),
        (Concentration(3), Multiplier()),
    ],
)
def test_ledger_closes_for_every_model_and_treatment(model, treatment, motion):
    ledger = Ledger()
    cells = 10 if motion is confined_column else (1, 10)
    motion(treatment, c=FALLING, model=model, cells=cells).run(60.0, Fixed(5.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-11  # Newton's last quadratic remainder
    size = 0.5 if motion is confined_column else 0.5 * 0.02
    assert ledger.fluid_left["top"][-1] < -1e-4 * size
    assert np.abs(np.diff(ledger.cations)).max() > 1e-5 * size


PAIRS = [
    (Concentration(), Multiplier(), Multiplier()),
    (Concentration(), Multiplier(), Penalty(relative=1e3)),
    (Concentration(), Multiplier(), Nitsche()),
    (Concentration(), Nitsche(), Penalty(relative=1e3)),
    (Potential(), Essential(), Essential()),
    (Potential(), Essential(), Penalty(relative=1e3)),
]


@pytest.mark.parametrize(("model", "first", "second"), PAIRS)
def test_ledger_with_two_baths_that_share_a_corner(model, first, second):
    ledger = Ledger()
    baths = [Bath("top", c=Ramp((0, 1.0), (100, 0.9)), treatment=first), Bath("right", c=1.0, treatment=second)]
    scene = quarter(cells=3, model=model, baths=baths, charge=Ramp((0, 0.0), (100, 0.5)))
    scene.run(100.0, Fixed(25.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-10  # relative to what is held; Newton's remainder
    assert min(abs(ledger.fluid_left[side][-1]) for side in ("top", "right")) > 1e-4
    assert abs(ledger.cations_left["top"][-1] - ledger.cations_left["right"][-1]) > 1e-5  # the baths differ


def test_ledger_keeps_two_baths_apart():
    ledger = Ledger()
    scene = strip(baths=[Bath("top", c=FALLING, treatment=Frozen()), Bath("bottom", c=0.15, treatment=Penalty(1.0))])
    scene.run(20.0, Fixed(5.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-11
    assert set(ledger.cations_left) == {"top", "bottom"}
    assert ledger.cations_left["top"][-1] > 0  # salt leaves towards the diluted bath
    assert abs(ledger.cations_left["bottom"][-1]) < ledger.cations_left["top"][-1] / 10


def test_a_ledger_without_the_boundary_flux_would_not_close():
    ledger = Ledger()
    confined_column(c=FALLING).run(60.0, Fixed(5.0), [ledger])
    assert np.abs(ledger.fluid - ledger.fluid[0]).max() / ledger.fluid.max() > 1e-4


class Renamed(Penalty):
    """The paper's penalty with other names to show."""

    def terms(self, contact):
        return [replace(term, name="exchange") for term in super().terms(contact)]


class Unmarked(Penalty):
    """The same without a role: nothing says that its terms take something out."""

    def terms(self, contact):
        return [replace(term, role=Role.INNER) for term in super().terms(contact)]


def imbalance(treatment):
    ledger = Ledger()
    confined_column(treatment, c=FALLING, cells=10).run(60.0, Fixed(5.0), [ledger])
    return ledger.imbalance()


def test_the_ledger_goes_by_roles_not_by_names():
    plain, renamed = imbalance(Penalty(1.0)), imbalance(Renamed(1.0))
    assert renamed == plain
    assert max(plain.values()) < 1e-11  # Newton's last quadratic remainder
    assert min(imbalance(Unmarked(1.0)).values()) > 1e-3  # control: what crosses is booked twice


def test_a_balance_without_content_is_no_division_by_zero():
    ledger = Ledger()
    scene = confined_column(None, model=Potential(), material=replace(TABLE_1, cfc0=0.0), cells=2, loads=[])
    scene.run(5.0, Fixed(5.0), [ledger])
    assert set(ledger.imbalance()) == {"fluid", "cations"}
