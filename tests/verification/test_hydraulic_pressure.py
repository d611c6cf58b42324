"""The hydraulic pressure of a bath presses on the body, unless a porous plate carries it."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import x

from ngswell import (
    BACKWARD_EULER,
    TABLE_1,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    DampedNewton,
    Essential,
    Fixed,
    Frozen,
    InputError,
    Lagged,
    LocalDonnan,
    Material,
    Multiplier,
    Nitsche,
    Penalty,
    PlaneStrain,
    Potential,
    Ramp,
    Roller,
    Scene,
    Spatial,
    Symmetry,
    Uncharged,
    box,
    column,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import UNCHARGED, confined_column

LAYERED = Material(mu=1.0 + 0.3 * x, lam=0.02, nS0=0.25, cfc0=0.2 + 0.1 * x, D_plus=5e-4, D_minus=8e-4, K=1e-3)
EXACT = DampedNewton(tolerance=1e-11)

BODIES = {
    "confined": (lambda: column(1.0, 3), Confined(), [Roller("bottom", "x")], "top"),
    "plane strain": (
        lambda: rectangle(1.0, 1.0, 2, 2, triangles=True), PlaneStrain(), [Symmetry("left"), Symmetry("bottom")],
        "top|right",
    ),
    "axisymmetric": (
        lambda: rectangle(1.0, 1.0, 2, 2), Axisymmetric(), [Roller("left", "r"), Symmetry("bottom")], "top|right",
    ),
    "3-d": (
        lambda: box(1.0, 1.0, 1.0, 1, 1, 1), Spatial(), [Symmetry("left"), Symmetry("front"), Symmetry("bottom")],
        "top|right|back",
    ),
}  # fmt: skip

TREATED = [
    *((Potential(), treatment) for treatment in (Essential(), Penalty(3.0))),
    *((Concentration(), t) for t in (Penalty(3.0), Nitsche(), Multiplier(), Lagged(), Frozen())),
    *((model, treatment) for model in (LocalDonnan(), Uncharged()) for treatment in (Essential(), Penalty(3.0))),
]


def immersed(motion, model, treatment, P, **changes):
    """Coefficients, by unknown, of a layered body after two steps in a bath that is diluted, at P̄ all around."""
    mesh, kinematics, supports, wet = BODIES[motion]
    salt = None if isinstance(model, Uncharged) else Ramp((0, 0.15), (10, 0.13))
    material = replace(LAYERED, cfc0=0.0) if salt is None else LAYERED
    bath = Bath(wet, c=salt, P=P, treatment=treatment, **changes)
    scene = Scene(
        mesh=mesh(), kinematics=kinematics, material=material, model=model, supports=supports, baths=[bath],
        initial=(None if salt is None else 0.15, bath.hydraulic.at(0.0)),
    )  # fmt: skip
    end = scene.run(10.0, Fixed(5.0, scheme=BACKWARD_EULER), newton=EXACT).end
    return {name: end.values[part] for name, part in scene.problem.ranges.items()}


@pytest.mark.parametrize("motion", BODIES)
@pytest.mark.parametrize(("model", "treatment"), TREATED)
def test_pressure_all_around_changes_the_pressure_alone(model, treatment, motion):
    # Incompressible constituents. At 2 N/mm² from the start, twice the shear modulus, the body keeps its equilibrium.
    calm, pressed = (immersed(motion, model, treatment, P) for P in (0.0, 2.0))
    for name, values in calm.items():
        shift = 2.0 if name == model.balanced["fluid"] else 0.0
        # Newton's tolerance: 1e-11 of natural sizes up to 1.7 (mm), and round-off of P̄ over the stiffness, 1e-15.
        assert pressed[name] == pytest.approx(values + shift, abs=1e-10), name
    assert np.abs(calm["u"]).max() > 1e-3 or isinstance(model, Uncharged)  # mm: something happens meanwhile


def test_a_rising_pressure_all_around_moves_nothing():
    # Negative control: behind a porous plate the same pressure inflates the body.
    rising = Ramp((0, 0.0), (10, 0.05))
    calm, pressed, behind = (
        immersed("plane strain", Potential(), None, P, porous_plate=plate)
        for P, plate in ((0.0, False), (rising, False), (rising, True))
    )
    assert pressed["u"] == pytest.approx(calm["u"], abs=1e-10)
    assert np.abs(behind["u"] - calm["u"]).max() > 0.01


@pytest.mark.parametrize("plate", [False, True])
@pytest.mark.parametrize("model", [Uncharged(3), Potential(3)])
def test_a_permeated_plug_is_pressed_against_its_filter(model, plate):
    """Fluid at P̄ = 0.25 N/mm² enters at the top and leaves through a filter at the held bottom, at 0.

    Without charge the steady flux is uniform, K/J dp/dX = q, and the solid bears σ = p − P̄ (σ = p where a porous plate
    carries P̄): dX ∝ dσ/J(σ), so the top moves by h ∫(J − 1) dσ/J over ∫ dσ/J, σ from its value at the bottom to the top's.
    """
    P, height = 0.25, 1.0
    nodes, weights = np.polynomial.legendre.leggauss(20)
    stresses = P * (nodes + 1) / 2 - (0.0 if plate else P)
    J = np.array([homogeneous_equilibrium(UNCHARGED, 1.0, "confined", load=-s).J for s in stresses])
    exact = height * (weights @ (1 - 1 / J)) / (weights @ (1 / J))
    assert exact == pytest.approx(0.26790746 if plate else -0.22224117, abs=1e-8)  # 20 points: steady to nine digits

    salt = None if isinstance(model, Uncharged) else 0.15
    scene = Scene(
        mesh=column(height, 8), kinematics=Confined(), material=UNCHARGED, model=model, supports=[Roller("bottom", "x")],
        baths=[Bath("top", c=salt, P=P, porous_plate=plate), Bath("bottom", c=salt)], initial=(salt, 0.0),
    )  # fmt: skip
    state = scene.state(scene.equilibrate())
    # u of order 3, p of order 2: fourth order at the nodes; measured 8.7e-8 on 8 cells, 5.4e-9 on 16.
    assert state.at((height,), "displacement") == pytest.approx(exact, abs=3e-7)


@pytest.mark.parametrize("motion", ["confined", "plane strain", "3-d"])
def test_at_rest_the_closed_form_holds(motion):
    mesh, kinematics, supports, wet = BODIES[motion]
    baths = [Bath(wet, c=0.3, P=0.4)]
    scene = Scene(mesh=mesh(), kinematics=kinematics, material=TABLE_1, supports=supports, baths=baths)
    state, closed = scene.state(scene.equilibrate()), homogeneous_equilibrium(TABLE_1, 0.3, motion, hydraulic=0.4)
    middle = (0.4,) * scene.mesh.dim
    assert closed.J == homogeneous_equilibrium(TABLE_1, 0.3, motion).J
    for name, value in (("J", closed.J), ("p", closed.p), ("cfc", closed.cfc)):
        assert state.at(middle, name) == pytest.approx(value, rel=1e-8)  # Newton's tolerance


def test_what_presses_is_said():
    def described(**changes):
        return confined_column(baths=[Bath("top", c=0.15, **changes)]).describe()

    assert "pressure of the bath on top" in described(P=0.1)
    assert "pressure of the bath" in described(P=Ramp((0, 0.0), (10, 0.1)))
    assert "pressure of the bath" not in described() + described(P=Ramp((0, 0.0), (10, 0.0)))
    behind = described(P=0.1, porous_plate=True)
    assert "pressure of the bath" not in behind
    assert "a porous plate carries its pressure" in behind


def test_a_plate_is_there_or_not():
    with pytest.raises(InputError, match="porous_plate has to be True or False"):
        Bath("top", c=0.15, porous_plate="yes")
