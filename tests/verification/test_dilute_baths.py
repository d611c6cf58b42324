"""Dilution to almost pure water, gradually and at once: which models and treatments get through, and where they end.

In a bath of 1e-9 mol/l the gel holds 1e-17 of anions: c₊ is the charge to round-off, and c̃ = sqrt(c₊ c₋) still is a number.
"""

import pytest

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Area,
    Concentration,
    DampedNewton,
    Essential,
    Ledger,
    Multiplier,
    Nitsche,
    Penalty,
    Potential,
    Probe,
    Ramp,
    StepError,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.models import concentration
from ngswell.setup.snapshot import Snapshot
from studies.hard_cases.bodies import block_scene
from tests.scenes import P0, confined_column

CHOICES = {
    "Concentration": (Concentration(), None),
    "Concentration, Multiplier": (Concentration(), Multiplier()),
    "Concentration, Nitsche": (Concentration(), Nitsche()),
    "Potential": (Potential(), Essential()),
    "Potential, order 3": (Potential(3), Essential()),
    "Potential, Penalty": (Potential(), Penalty(relative=1e4)),
}


@pytest.mark.parametrize("until_diluted", [10.0, 0.0], ids=["ramp", "at once"])
@pytest.mark.parametrize("end", [1e-2, 1e-9])
@pytest.mark.parametrize("choice", CHOICES)
def test_column(choice, end, until_diluted):
    model, treatment = CHOICES[choice]
    c = Ramp((0, 0.15), (until_diluted, end)) if until_diluted else end
    scene = confined_column(treatment, c=c, model=model, cells=10, initial=(0.15, 0.0))
    probe, ledger = Probe((0.1,), "J", "p", "c_plus", "cfc"), Ledger()
    result = scene.run(1e6, Adaptive(1e-2), [probe, ledger], newton=DampedNewton())
    rest = homogeneous_equilibrium(TABLE_1, end, "confined", load=P0)
    # A homogeneous state lies in every space. What is left of the penalty at the last steps of 1e5 s is round-off, 1e-10.
    for name, value in (("J", rest.J), ("p", rest.p), ("c_plus", rest.c), ("cfc", rest.cfc)):
        assert probe.values[name].ravel()[-1] == pytest.approx(value, rel=1e-8), name
    assert max(ledger.imbalance().values()) < 1e-7  # round-off of p times ε and the last steps
    assert len(result.steps) < 150  # 60 to 80


def diluted_area(choice, end, duration, until):
    """Areas over time, of the block at rest in 1 mol/l whose bath goes to `end` within `duration` [s]."""
    model, treatment = CHOICES[choice]
    swollen = Snapshot(0.0, block_scene(model, treatment, 1.0, 4).equilibrate().values)
    scene, area = block_scene(model, treatment, Ramp((0, 1.0), (duration, end)) if duration else end, 4), Area()
    scene.run(until, Adaptive(1e-4), [area], resume=swollen, newton=DampedNewton())
    return area.values


@pytest.mark.parametrize(
    ("choice", "end"),
    [
        *((choice, 1e-2) for choice in CHOICES if "order" not in choice and choice != "Concentration"),
        *(
            (choice, 1e-9)
            for choice in ("Concentration, Multiplier", "Concentration, Nitsche", "Potential", "Potential, Penalty")
        ),
    ],
)
def test_block_after_a_ramp(choice, end):
    areas = diluted_area(choice, end, 10.0, 3e6)
    # Rest after some fifty relaxation times: Newton's tolerance, and what the last steps leave of the penalty.
    assert areas[-1] == pytest.approx(homogeneous_equilibrium(TABLE_2, end, "plane strain").J, rel=1e-7)
    assert areas[-1] / areas[0] > 1.5


def test_nitsches_method_does_not_pass_off_negative_anions(monkeypatch):
    # With γ = 20 they fall below zero in the layer at the bath, by between 1 and 10 % of the cations; with 50 they do not.
    monkeypatch.setitem(CHOICES, "Concentration, Nitsche", (Concentration(), Nitsche(20.0)))
    with pytest.raises(StepError, match=r"ion concentration .* positive.* in place of Nitsche"):
        diluted_area("Concentration, Nitsche", 1e-9, 10.0, 100.0)
    monkeypatch.setattr(concentration, "NEGLIGIBLE", 0.1)
    assert diluted_area("Concentration, Nitsche", 1e-9, 10.0, 20.0)[-1] > 1


@pytest.mark.parametrize(
    "choice", ["Concentration, Multiplier", "Concentration, Nitsche", "Potential", "Potential, Penalty"]
)
def test_block_at_once(choice):
    areas = diluted_area(choice, 1e-2, 0.0, 50.0)
    # It gets through, and swells by what the coarse mesh makes of 0.104, the growth on fine meshes: a layer of
    # sqrt(D t) = 0.2 mm within one cell. Measured 0.21 with p and c, 0.14 with P and c̃ as unknowns.
    assert 0.05 < areas[-1] / areas[0] - 1 < 0.3


def test_sharp_layers_are_resolved_better_by_the_virtual_bath():
    reference, by_c, by_potentials = (
        (areas := diluted_area(choice, 1e-2, 0.0, 50.0))[-1] / areas[0] - 1
        for choice in ("Potential, order 3", "Concentration, Multiplier", "Potential, Penalty")
    )
    assert abs(by_potentials - reference) < 0.5 * abs(by_c - reference)
