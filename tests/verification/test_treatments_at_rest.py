"""Every treatment of a bath leads to the same state of rest, whatever K and D do on deformation, and to none
where none is.

A homogeneous state of rest lies in every space, and the exact solution satisfies every treatment there: what is left is the
nonlinear solve. With penalties of the parameter K in place of K(J) one in ten of these columns came to rest elsewhere.
"""

from dataclasses import replace

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Concentration,
    Fixed,
    HolmesMow,
    InputError,
    Ledger,
    MackieMeares,
    Material,
    Multiplier,
    Nitsche,
    Penalty,
    Potential,
    PowerLaw,
    Probe,
    Ramp,
    StepError,
    Traction,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.mesh.points import points
from ngswell.physics import laws
from studies.hard_cases.bodies import ACCURATE
from tests.scenes import confined_column, quarter

NITSCHE = [Nitsche(), Nitsche(20.0), Nitsche(5.0, "none"), Nitsche(0.0, "skew")]
SOFT = {"mu": 0.0404, "lam": 0.0404, "nS0": 0.399, "cfc0": 0.2314, "D_plus": 1.24e-3, "D_minus": 1.59e-3, "K": 3.14e-4}
REAL = {"phi": 0.9326, "phi_bath": 0.99165, "Gamma": 1.00074}
HARD = Material(
    mu=0.35863, lam=0.0, nS0=0.44414, cfc0=0.70299, D_plus=1.73e-3, D_minus=4.17e-4, K=8.617e-5, **REAL,
    permeability=HolmesMow(1.0, 1.0),
)  # fmt: skip
CONSTANT = Material(
    mu=0.148968, lam=0.0, nS0=0.40166, cfc0=0.62628, D_plus=8.59973e-4, D_minus=1.79032e-3, K=1.13495e-5,
    phi=0.886561, phi_bath=1.029693, Gamma=0.969071,
)  # fmt: skip
UNEVEN = Material(
    mu=0.05888, lam=0.0, nS0=0.350657, cfc0=0.305942, D_plus=8.8987e-4, D_minus=1.04065e-3, K=5.20849e-5,
    phi=1.09932, phi_bath=1.09952, Gamma=1.08955, permeability=HolmesMow(2.3158, 2.01343), diffusivity=MackieMeares(),
)  # fmt: skip
CASES = {
    "HolmesMow(1, 1), order 4": (HARD, 0.01904, 4, 1.946557),
    "PowerLaw(4), order 3": (Material(**SOFT, permeability=PowerLaw(4.0)), 0.0137, 3, 2.5623),
    "PowerLaw(2), order 4": (Material(**SOFT, permeability=PowerLaw(2.0)), 0.0137, 4, 2.5623),
    "constant K, order 6": (CONSTANT, 0.09236, 6, 1.8993),
}
"""Material, bath [mol/l], order and J at rest of columns that Nitsche's method brought to rest elsewhere, by up to 23 %."""


def column_at(material, salt, order, treatment, cells=4, **changes):
    model = Concentration(order=order)
    return confined_column(treatment, salt, cells, material=material, model=model, loads=(), **changes)


def J_of(scene, snapshot):
    return scene.state(snapshot).J(points(scene.mesh, order=4)).ravel()


@pytest.mark.parametrize("treatment", NITSCHE, ids=str)
@pytest.mark.parametrize("case", CASES)
def test_nitsche_comes_to_rest_where_the_closed_form_is(case, treatment):
    material, salt, order, J = CASES[case]
    exact = homogeneous_equilibrium(material, salt, "confined").J
    assert exact == pytest.approx(J, rel=1e-4)
    scene = column_at(material, salt, order, treatment)
    assert J_of(scene, scene.equilibrate()) == pytest.approx(exact, rel=1e-6)  # Newton's 1e-8 of the height


def test_penalties_of_the_parameters_are_wrong(monkeypatch):
    """Control: γ K/h and γ D₊/h of the undeformed body, as large as they may be for the order 2, hold no body of order 4."""
    material, salt, order, _ = CASES["PowerLaw(4), order 3"]
    exact = homogeneous_equilibrium(material, salt, "confined").J

    def off():
        scene = column_at(material, salt, order + 1, Nitsche(20.0))
        try:
            return np.abs(J_of(scene, scene.equilibrate()) / exact - 1).max()
        except StepError:
            return np.inf

    assert off() < 1e-6
    monkeypatch.setattr(laws, "own_conductances", lambda m, J, c, cfc: (m.K / 9, m.D_plus / 9))
    assert off() > 1e-2


def test_a_transient_under_a_law():
    """The top of one cell of order 5 halfway and at the end; with the parameter's K 0.438 mm, the ledger closed."""
    duration = 0.25 / (2 * UNEVEN.mu * UNEVEN.K)

    def rise(treatment, cells, model):
        probe, ledger = Probe((0.5,), "displacement", when=[3 * duration, 8 * duration]), Ledger()
        bath = Ramp((0, 0.141878), (duration, 0.0155857))
        charge = Ramp((0, 0.0), (5 * duration, 1.0))
        parts = {"charge": charge, "initial": (0.141878, 0.0), "material": UNEVEN, "model": model, "loads": ()}
        scene = confined_column(treatment, bath, cells, **parts)
        scene.run(8 * duration, Adaptive(1e-2), [probe, ledger], newton=ACCURATE)
        assert max(ledger.imbalance().values()) < 1e-10
        return np.ravel(probe.values["displacement"])[-2:]

    exact = rise(None, 8, Potential(order=5))
    assert exact[1] == pytest.approx(0.9366, abs=2e-4)
    for treatment in (*NITSCHE[:3], Penalty(relative=1e4), Multiplier()):
        # The tolerance in time, relative to the largest rise.
        assert rise(treatment, 1, Concentration(order=5)) == pytest.approx(exact, abs=1e-2 * exact[1])


@pytest.mark.parametrize("treatment", [*NITSCHE[:3], Penalty(relative=1e4), Multiplier()], ids=str)
def test_no_state_of_rest_is_found_where_none_exists(treatment):
    """A weak gel whose osmotic coefficients let it swell without bound; J of 4 to 120 was found with the parameter's K."""
    gel = replace(TABLE_2, mu=0.05, lam=0.0, phi_bath=0.95, permeability=PowerLaw(2.0))
    with pytest.raises(InputError, match="swells without bound"):
        homogeneous_equilibrium(gel, 1.0, "plane strain")
    scene = quarter(treatment, 1.0, 2, material=gel, model=Concentration())
    with pytest.raises(StepError, match="finds no state of rest"):
        scene.equilibrate()


@pytest.mark.parametrize("m", [2.0, 4.0])
def test_relaxation_ends(m):
    """Beyond what the solid bears, K falls to nothing with the fluid: relaxation would creep on for ever longer."""
    nS0, mu = 0.25, 0.24
    drained = replace(TABLE_1, cfc0=0.0, lam=0.0, permeability=PowerLaw(m))
    load = Traction("top", (-1.01 * mu * (1 - nS0**2) / nS0,))
    scene = confined_column(Penalty(relative=1e4), 0.15, 10, material=drained, model=Concentration(), loads=[load])
    with pytest.raises(StepError, match=r"finds no state of rest.* Remedies:"):
        scene.equilibrate()


@pytest.mark.parametrize("treatment", [Penalty(relative=1e4), Penalty(40.0), *NITSCHE[:3], Multiplier()], ids=str)
def test_fields_by_the_domains_of_the_mesh(treatment):
    """K, D and the rest given by the mesh's domains are those numbers in every treatment, to Newton's tolerance."""
    mesh = rectangle(1.0, 1.0, 2, 2)

    def middle(field):
        names = ("mu", "lam", "nS0", "cfc0", "D_plus", "D_minus", "K")
        material = replace(TABLE_2, **{name: field(getattr(TABLE_2, name)) for name in names})
        parts = {"mesh": mesh, "material": material, "model": Concentration(), "initial": (1.0, 0.0)}
        scene = quarter(treatment, Ramp((0, 1.0), (100, 0.7)), charge=Ramp((0, 0.0), (100, 1.0)), **parts)
        return scene.run(200.0, Fixed(50.0)).state.at((0.5, 0.5), "J")

    assert middle(lambda number: mesh.MaterialCF({}, default=number)) == pytest.approx(middle(float), rel=1e-8)
