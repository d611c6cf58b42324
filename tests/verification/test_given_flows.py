"""Fluid and salt driven through a boundary, tractions on the solid alone, weights with a history."""

from dataclasses import replace
from math import exp, pi

import numpy as np
import pytest
from ngsolve import x

from ngswell import (
    TABLE_1,
    Adaptive,
    Axisymmetric,
    Bath,
    Blend,
    Concentration,
    Confined,
    DampedNewton,
    Efflux,
    Fixed,
    InputError,
    Ledger,
    LocalDonnan,
    Material,
    PlaneStrain,
    Potential,
    Ramp,
    Roller,
    Scene,
    Sine,
    Spherical,
    Traction,
    Uncharged,
    UnitsWarning,
    Weight,
    column,
    rectangle,
)
from ngswell.physics.solid import homogeneous_response
from tests.scenes import P0

HEIGHT, K, D = 2.0, 1e-3, 5e-4  # mm, mm⁴/(N s), mm²/s
STIFF = Material(mu=1e3, lam=1e2, nS0=0.25, cfc0=0.0, D_plus=D, D_minus=D, K=K)


def stiff(model, *loads, **changes):
    """A column without charge that hardly strains, under a bath of 0.1 mol/l."""
    pieces = {
        "mesh": column(HEIGHT, 8), "kinematics": Confined(), "material": STIFF, "model": model,
        "supports": [Roller("bottom", "x")], "loads": loads,
        "baths": [Bath("top", c=0.1 if "cations" in model.balanced else None)],
    }  # fmt: skip
    return Scene(**(pieces | changes))


# -- given flows -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [Potential(), Uncharged()])
def test_a_given_seepage_makes_a_linear_pressure(model):
    # q = −K p′, p linear and so in the space; what is left is the strain, up to p/(2µ + λ) = 1e-6.
    scene = stiff(model, Efflux("bottom", fluid=-1e-6))
    rest = scene.state(scene.equilibrate())
    for at in (0.0, 1.0, 1.7):
        assert rest.at((at,), "p") == pytest.approx(1e-6 * (HEIGHT - at) / K, rel=2e-6)
    assert rest.at((0.9,), "seepage")[0] == pytest.approx(1e-6, rel=1e-6)  # upwards: what comes in at the bottom


@pytest.mark.parametrize("model", [Potential(3), Concentration(3)])
def test_given_salt_and_fluid_make_an_exponential_concentration(model):
    # j = q c − n D c′ with c = 0.1 at the top. Quadratic c on 8 cells, of order 4 at vertices: 1e-5 is left.
    q, j = 5e-4, 4e-4
    with pytest.warns(UnitsWarning):  # so permeable that no seepage strains it
        scene = stiff(model, Efflux("bottom", fluid=-q, cations=-j), material=replace(STIFF, K=1.0))
    rest = scene.state(scene.equilibrate())
    for at in (0.0, 1.0):
        exact = j / q + (0.1 - j / q) * exp(q * (at - HEIGHT) / (0.75 * D))
        assert rest.at((at,), "c_plus") == pytest.approx(exact, rel=2e-5)
    assert abs(exact - (0.1 + j * (HEIGHT - 1.0) / (0.75 * D))) > 0.1  # control: diffusion alone


@pytest.mark.parametrize("steps", [Fixed(10.0), Adaptive(1e-3)])
@pytest.mark.parametrize("model", [Potential(), Concentration()])
def test_ledgers_count_given_flows(model, steps):
    # Round-off of sums. The integral of a ramp over [0, 50] and after is exact in fourth order, a step late in first.
    flow = Ramp((0, 0.0), (50, 1e-4))
    ledger = Ledger()
    scene = Scene(
        mesh=rectangle(0.5, 0.5, 2, 2), kinematics=PlaneStrain(), material=TABLE_1, model=model,
        supports=[Roller("bottom", "y"), Roller("left|right", "x")], baths=[Bath("top", c=0.15)],
        loads=[Traction("top", (0.0, -P0)), Efflux("right", fluid=flow, cations=2e-5), Efflux("bottom", cations=-1e-5)],
    )  # fmt: skip
    scene.run(100.0, steps, [ledger], newton=DampedNewton())
    assert max(ledger.imbalance().values()) < 1e-11
    exact = 0.5 * 1e-4 * (75 if steps == Adaptive(1e-3) else 80)
    assert ledger.fluid_left["right"][-1] == pytest.approx(exact, rel=1e-9)
    assert ledger.cations_left["right"][-1] == pytest.approx(0.5 * 2e-5 * 100, rel=1e-9)  # with what touches the bath
    assert ledger.cations_left["bottom"][-1] == pytest.approx(-0.5 * 1e-5 * 100, rel=1e-9)
    assert ledger.fluid_left["bottom"][-1] == 0.0
    assert ledger.fluid_left["top"][-1] < -1e-4


def test_given_flows_count_whole_turns_about_an_axis():
    ledger = Ledger()
    scene = Scene(
        mesh=rectangle(0.5, 0.4, 2, 2), kinematics=Axisymmetric(), material=STIFF, model=Uncharged(),
        supports=[Roller("bottom", "z"), Roller("left", "r")], baths=[Bath("top")], loads=[Efflux("right", fluid=1e-6)],
    )  # fmt: skip
    scene.run(10.0, Fixed(5.0), [ledger])
    assert ledger.fluid_left["right"][-1] == pytest.approx(1e-5 * 2 * pi * 0.5 * 0.4, rel=1e-12)


def test_a_sealed_body_takes_what_is_given():
    # One displacement and no bath: the volume grows by what comes in.
    ledger = Ledger()
    scene = stiff(Uncharged(), Efflux("bottom", fluid=-1e-5), baths=[], initial=(None, 0.0))
    result = scene.run(100.0, Fixed(50.0), [ledger])
    assert result.state.at((HEIGHT,), "displacement") == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Efflux("bottom"), "nothing leaves"),
        (lambda: Efflux("bottom", fluid=float("nan")), "fluid"),
        (lambda: Efflux("bottom", cations=1e9), "cations"),
        (lambda: stiff(Potential(), Efflux("top", fluid=1e-6)), "has a bath"),
        (lambda: stiff(Potential(), Efflux("side", fluid=1e-6)), "no boundary 'side'"),
        (lambda: stiff(Uncharged(), Efflux("bottom", cations=1e-6)), "does not balance salt"),
        (lambda: stiff(LocalDonnan(), Efflux("bottom", cations=1e-6), baths=[Bath("top", c=0.1)]), "does not balance salt"),
        (lambda: stiff(Potential(), Efflux("bottom", fluid=1e-6), Efflux("bottom", cations=1.0)), "add them up"),
    ],
)
def test_flows_that_cannot_be_are_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


# -- effective tractions -----------------------------------------------------------------------------------------------

SIDES = [Roller("bottom", "y"), Roller("left", "x")]


@pytest.mark.parametrize("model", [Potential(), Concentration()])
@pytest.mark.parametrize(
    ("motion", "mesh", "supports", "boundary"),
    [
        (Confined(), column(1.0, 3), [Roller("bottom", "x")], "top"),
        (PlaneStrain(), rectangle(1.0, 1.0, 2, 2), SIDES, "top|right"),
        (Axisymmetric(), rectangle(1.0, 1.0, 2, 2), [Roller("bottom", "z"), Roller("left", "r")], "top|right"),
        (Spherical(), column(1.0, 3), [Roller("bottom", "r")], "top"),
    ],
)
def test_a_solid_without_traction_of_its_own_does_not_swell(model, motion, mesh, supports, boundary):
    # Extra stress 0 at the surface and at rest everywhere: J = 1 in any bath. Homogeneous, so Newton's round-off is left.
    loads = [Traction(name, (0.0,) * mesh.dim, effective=True) for name in boundary.split("|")]
    scene = Scene(
        mesh=mesh, kinematics=motion, material=TABLE_1, model=model, supports=supports,
        baths=[Bath(boundary, c=0.15, P=0.05, porous_plate=True)], loads=loads,
    )  # fmt: skip
    rest = scene.state(scene.equilibrate())
    place = (0.4,) * mesh.dim
    assert rest.at(place, "J") == pytest.approx(1.0, abs=1e-12)
    assert rest.at(place, "p") == pytest.approx(P0 + 0.05, rel=1e-12)
    free = Scene(**{n: getattr(scene, n) for n in ("mesh", "kinematics", "material", "supports", "baths")})
    assert free.state(free.equilibrate(unstable="off")).at(place, "J") > 1.1  # control: with none at all it swells


@pytest.mark.parametrize("c", [0.05, 2.0])
def test_an_effective_traction_is_the_extra_stress_in_every_bath(c):
    scene = Scene(
        mesh=column(1.0, 3), kinematics=Confined(), material=TABLE_1, supports=[Roller("bottom", "x")],
        baths=[Bath("top", c=c)], loads=[Traction("top", (Ramp((0, 0.0), (10, -0.1)),), effective=True)],
    )  # fmt: skip
    J = scene.state(scene.equilibrate(10.0)).at((0.5,), "J")
    assert J < 0.9
    assert homogeneous_response(TABLE_1, 1)(J - TABLE_1.number("nS0")) == pytest.approx(-0.1, rel=1e-9)  # dψ/dJ


@pytest.mark.parametrize("others", [(), (Efflux("bottom", fluid=-1e-4),)], ids=["sealed", "given flux"])
def test_an_effective_traction_without_a_bath_is_refused(others):
    """Such runs ended after 0.2 s on 3, 5e-2 s on 6 and 3e-4 s on 10 cells, whatever their steps: ill-posed."""
    with pytest.raises(InputError, match="'bottom': it is effective, and no bath gives the pore pressure"):
        Scene(
            mesh=column(1.0, 3), kinematics=Confined(), material=TABLE_1, supports=[Roller("top", "x")],
            baths=[Bath("top", c=0.15)], loads=[Traction("bottom", (0.0,), effective=True), *others],
        )  # fmt: skip


def test_an_effective_traction_beside_the_pressure_of_a_bath_is_refused():
    with pytest.raises(InputError, match="porous_plate"):
        stiff(Potential(), Traction("top", (0.0,), effective=True), baths=[Bath("top", c=0.1, P=0.1)])


# -- weights with a history --------------------------------------------------------------------------------------------


def test_a_centrifuge_that_spins_up_makes_the_pressure_that_it_should():
    # Hydrostatic: p = ∫ w dx. A weight that grows with the distance from the top, w = w₁ (H − x)/H, makes
    # p = w₁ (H − x)²/(2H), parabolic: nodes of linear p on 16 cells are exact but for the strain, 1e-6.
    spin = Ramp((0, 0.0), (100, -1e-3))
    down = Blend(spin, Ramp((0, 0.0)), x / HEIGHT)
    scene = stiff(Uncharged(), Weight(fluid=(down,), solid=(down,)), mesh=column(HEIGHT, 16))
    for time, share in ((40.0, 0.4), (100.0, 1.0)):
        rest = scene.state(scene.equilibrate(time))
        assert rest.at((0.5,), "p") == pytest.approx(share * 1e-3 * 1.5**2 / (2 * HEIGHT), rel=1e-5)
        assert abs(rest.at((0.53,), "seepage")[0]) < 0.07 * K * share * 1e-3  # none but what linear p leaves in a cell, h/H


def test_a_weight_that_swings_drives_fluid_to_and_fro():
    # A stiff column follows at once: the run's last state, at the mean weight, is that of rest, to the tolerance of steps.
    swing = Sine(-1e-4, 5e-5, 20.0, 2)
    scene = stiff(Uncharged(), Weight(fluid=(swing,), solid=(-1e-4,)), start=-50.0)
    ledger = Ledger()
    result = scene.run(60.0, Adaptive(1e-3), [ledger])
    assert result.state.at((1.0,), "p") == pytest.approx(1e-4, rel=1e-3)
    assert np.ptp(ledger.fluid) > 0  # it breathes


@pytest.mark.parametrize(
    "make",
    [
        lambda: Weight((Ramp((0, 0.0), (1, 5.0)),), (0.0,)),
        lambda: Weight((float("nan"),), (0.0,)),
        lambda: stiff(Uncharged(), Weight((Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), 2 * x),), (0.0,))),
    ],
)
def test_weights_that_cannot_be_are_refused(make):
    with pytest.raises(InputError):
        make()
