"""Fibres that bear tension only: stress, refusals, bodies in every motion, and rest across their kink."""

from dataclasses import replace
from math import log, pi, sqrt

import numpy as np
import pytest
from ngsolve import CF, IfPos, x, y

from ngswell import (
    TABLE_2,
    Adaptive,
    Axisymmetric,
    Bath,
    Cylindrical,
    FibreDistribution,
    FibreReinforced,
    Fibres,
    InputError,
    LogNeoHookean,
    Material,
    NeoHookean,
    PlaneStrain,
    Ramp,
    Roller,
    Scene,
    StepError,
    Traction,
    Uncharged,
    by_region,
    ray,
    rectangle,
)
from ngswell.closed_forms.consolidation import consolidation_coefficient
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.physics.fibres import hemisphere
from ngswell.physics.solid import small_strain_moduli
from ngswell.run.digest import setup_digest
from tests.scenes import FREE
from tests.unit.physics.test_elastic import F, energy, nominal

OBLIQUE = (1.0, 2.0, -0.5)


def alone(*laws):
    """A material whose solid is fibres only, for stresses."""
    return replace(TABLE_2, solid=laws[0])


def reinforced(*families, ground=None, **changes):
    return replace(TABLE_2, **{"solid": FibreReinforced(ground or LogNeoHookean(), families), **changes})


def of_family(F, direction, xi, beta, alpha):
    """Nominal stress of one family as textbooks write it, F 2 ψ'(Iₙ) N⊗N."""
    N = np.array(direction) / np.linalg.norm(direction)
    strain = N @ F.T @ F @ N - 1
    if strain <= 0:
        return np.zeros((3, 3))
    return 2 * xi * strain ** (beta - 1) * np.exp(alpha * strain**beta) * F @ np.outer(N, N)


@pytest.mark.parametrize(("beta", "alpha"), [(2.0, 0.0), (2.0, 5.0), (3.0, 0.0), (2.7, 1.3)])
def test_stress_is_that_of_textbooks(beta, alpha):
    for direction in [(1, 0, 0), (0, 0, 3), OBLIQUE]:
        m = alone(Fibres(direction, 1.5, beta, alpha))
        for G in [np.diag([1.3, 1.0, 1.0]), np.diag([0.8, 1.0, 1.0]), np.diag([1.2, 1.2, 0.7]), F, np.linalg.inv(F)]:
            assert nominal(G, m) == pytest.approx(of_family(G, direction, 1.5, beta, alpha), abs=1e-13)  # round-off
    assert (nominal(np.diag([0.8, 0.9, 0.95]), alone(Fibres(OBLIQUE, 1.5, beta, alpha))) == 0).all()


FAMILIES = [Fibres(OBLIQUE, 1.5, 2.7, 1.3), FibreDistribution(1.2, 2.0, 0.5), FibreDistribution((1.0, 2.0, 3.0), 3.0)]


@pytest.mark.parametrize("law", FAMILIES, ids=str)
def test_stress_is_the_slope_of_the_energy_and_turns_with_the_body(law):
    m, step = alone(law), 1e-5
    found = nominal(F, m)
    for place in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[place] = step
        slope = (energy(F + change, m) - energy(F - change, m)) / (2 * step)
        assert slope == pytest.approx(found[place], abs=1e-7)  # step² and round-off/step, of stresses of 1 to 10
    Q = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]])
    assert energy(Q @ F, m) == pytest.approx(energy(F, m), rel=1e-12)
    assert nominal(Q @ F, m) == pytest.approx(Q @ found, abs=1e-12)
    assert np.abs(nominal(F @ Q, m) - found @ Q).max() > 1e-2  # control: it has directions (or a few of them)


def test_several_families_add_up_and_a_direction_may_be_a_field():
    one, two = Fibres((1, 0, 0), 1.0), Fibres(OBLIQUE, 2.0, 3.0, 1.0)
    both = nominal(F, reinforced(one, two))
    ground = nominal(F, replace(TABLE_2, solid=LogNeoHookean()))
    assert both == pytest.approx(ground + nominal(F, alone(one)) + nominal(F, alone(two)), abs=1e-13)
    field = Fibres(CF((x, y, 0)), CF(2.0) * y, 3.0)  # at (0.3, 0.4)
    assert nominal(F, alone(field)) == pytest.approx(of_family(F, (0.3, 0.4, 0), 0.8, 3.0, 0.0), abs=1e-13)


# -- all directions ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("beta", [2.0, 3.0])
def test_fibres_in_all_directions_taut(beta):
    """Stretched along one axis, all are taut: ψ = 4π ξ/β (λ² − 1)^β/(2β + 1), which the quadrature has exactly."""
    stretch = 1.4
    exact = 4 * pi * 1.2 / beta * (stretch**2 - 1) ** beta / (2 * beta + 1)
    for axis in range(3):
        found = energy(np.diag([stretch if axis == i else 1.0 for i in range(3)]), alone(FibreDistribution(1.2, beta)))
        assert found == pytest.approx(exact, rel=1e-12)


def test_an_ellipsoid_of_fibres():
    """Uniformly stretched, ψ = (λ² − 1)²/2 times the integral of ξ(N), of a spheroid a fourfold one of arcosh."""
    semiaxes = (1.0, 1.0, 2.0)
    e = sqrt(1 - 1 / 4)
    # ξ(N) = (1 − e² h²)^(−1/2) over heights h: 4π arcsin(e)/e
    exact = 4 * pi * np.arcsin(e) / e * (1.2**2 - 1) ** 2 / 2
    found = energy(1.2 * np.eye(3), alone(FibreDistribution(semiaxes)))
    for rings, error in ((4, 6e-4), (8, 1e-6)):  # Gauss points for a smooth function: the error is squared
        directions, weights = hemisphere(rings, 12)
        total = (weights / np.linalg.norm(directions / np.array(semiaxes), axis=1)).sum() * (1.2**2 - 1) ** 2 / 2
        assert total == pytest.approx(exact, rel=error)
    assert found == pytest.approx(exact, rel=6e-4)
    stress = np.diag(nominal(1.2 * np.eye(3), alone(FibreDistribution(semiaxes))))
    assert stress[0] == pytest.approx(stress[1], rel=1e-12)
    assert stress[2] > 1.1 * stress[0]


def test_fibres_in_all_directions_of_which_some_are_slack():
    directions, weights = hemisphere(60, 120)
    assert weights.sum() == pytest.approx(4 * pi, rel=1e-12)
    m = alone(FibreDistribution(1.2))
    for stretches in [(1.3, 0.88, 0.88), (0.8, 1.1, 1.1), (1.2, 1.0, 1 / 1.2)]:
        G = np.diag(stretches)
        exact = sum(w * of_family(G, N, 1.2, 2.0, 0.0) for N, w in zip(directions, weights, strict=True))
        error = np.abs(nominal(G, m) - exact).max() / np.abs(exact).max()
        assert error < 0.05  # as the class says: a kink inside the rule
    assert error > 1e-4  # control: the finer rule tells


# -- refusals ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Fibres((0, 0, 0), 1.0), r"direction \(0.0, 0.0, 0.0\) has no length"),
        (lambda: Fibres((1, 0), 1.0), "three components"),
        (lambda: Fibres(CF((x, y)), 1.0), "three components"),
        (lambda: Fibres((1, 0, 0), -1.0), "xi = -1 N/mm²"),
        (lambda: Fibres((1, 0, 0), 1.0, 1.5), "beta = 1.5 is outside 2 … 20: below 2 the stiffness"),
        (lambda: Fibres((1, 0, 0), 1.0, 2.0, -1.0), "alpha = -1"),
        (lambda: FibreDistribution(0.0), "xi has to be positive"),
        (lambda: FibreDistribution((1.0, 2.0)), "one number or three"),
        (lambda: FibreDistribution(1.0, 1.0), "beta = 1 "),
        (lambda: FibreReinforced(Fibres, []), "ground has to be a law"),
        (lambda: FibreReinforced(NeoHookean(), []), "fibres is empty"),
        (lambda: FibreReinforced(NeoHookean(), Fibres((1, 0, 0), 1.0)), "put it in brackets"),
        (lambda: body("plane strain", Fibres(CF((x - 0.5, 0.0, 0.0)) * IfPos(x - 0.5, 1, 0), 1.0)), "has the length 0 at a"),
        (lambda: body("plane strain", Fibres((1, 0, 0), x - 0.5)), "xi = -0.4.* N/mm² at a point"),
        (lambda: body("plane strain", Fibres((1, 0, 0), elsewhere())), "solid: fibres: xi is by_region of another mesh"),
    ],
)  # fmt: skip
def test_what_fibres_may_not_be(make, says):
    with pytest.raises(InputError, match=says):
        make()


def elsewhere():
    mesh = rectangle(1, 1, 2, 2)
    mesh.ngmesh.SetMaterial(1, "other")
    return by_region(mesh, other=1.0)


def test_closed_forms_refuse_what_has_a_direction_or_a_kink():
    along = reinforced(Fibres((1, 0, 0), 1.0))
    assert homogeneous_equilibrium(along, 0.3, "confined").J < homogeneous_equilibrium(TABLE_2, 0.3, "confined").J
    with pytest.raises(InputError, match="does not stretch alike in 2 free directions"):
        homogeneous_equilibrium(along, 0.3, "plane strain")
    for law in [Fibres((1, 0, 0), 1.0), FibreDistribution(1.0)]:
        with pytest.raises(InputError, match="not isotropic and linear at small strains"):
            small_strain_moduli(reinforced(law))
    with pytest.raises(InputError, match="direction varies in space"):
        homogeneous_equilibrium(reinforced(Fibres(CF((x, 1, 0)), 1.0)), 0.3, "confined")
    with pytest.raises(InputError, match="not isotropic"):
        consolidation_coefficient(reinforced(Fibres((1, 0, 0), 1.0), cfc0=0.0))


# -- bodies ------------------------------------------------------------------------------------------------------------

MOTIONS = {**FREE, "cylindrical": (lambda: ray(0.0, 1.0, 2), Cylindrical(), [Roller("inner", "r")], "outer")}


def body(motion, *families, salt=0.3, material=None, **changes):
    mesh, kinematics, supports, wet = MOTIONS[motion]
    return Scene(
        **{
            "mesh": mesh(), "kinematics": kinematics, "material": material or reinforced(*families), "supports": supports,
            "baths": [Bath(wet, c=salt)], **changes,
        }
    )  # fmt: skip


def along(strain, xi):
    """Kirchhoff stress of taut fibres, β = 2, along themselves, over Iₙ."""
    return 2 * xi * max(strain, 0.0)


def rest(motion, xi, m=TABLE_2, salt=0.3):
    """Stretches in the balance of fibres, ground and osmotic pressure, written out: J by bisection."""

    def stretches(J):
        cfc = (1 - m.nS0) * m.cfc0 / (J - m.nS0)
        excess = J * 2 * m.RT * (sqrt(salt**2 + cfc**2 / 4) - salt) - m.lam * log(J)  # is µ (a² − 1) + fibres
        free = 1 + excess / m.mu  # b², without fibres
        # µ (a² − 1) + 2 ξ a² (a² − 1) = excess, a quadratic in a²
        taut = (2 * xi - m.mu + sqrt((2 * xi - m.mu) ** 2 + 8 * xi * (m.mu + excess))) / (4 * xi)
        return {
            "confined": (taut, 1.0, 1.0),
            "plane strain": (taut, taut, 1.0),
            "cylindrical": (taut, taut, 1.0),
            "axisymmetric": (taut, taut, free),
            "3-d": (taut, taut, free),
        }[motion]

    low, high = 1.0 + 1e-9, 6.0
    while low < (middle := (low + high) / 2) < high:
        squares = stretches(middle)
        low, high = (middle, high) if min(squares) > 0 and np.prod(squares) > middle**2 else (low, middle)
    return low


BOTH = {
    "confined": [(1, 0, 0)],
    "plane strain": [(1, 0, 0), (0, 1, 0)],
    "cylindrical": [(1, 0, 0), (0, 1, 0)],
    "axisymmetric": [(1, 0, 0), (0, 0, 1)],
    "3-d": [(1, 0, 0), (0, 1, 0)],
}
"""Fibres along the directions that stretch alike; radial and hoop when axisymmetric."""
IDLE = {"confined": (0, 1, 0), "plane strain": (0, 0, 1), "cylindrical": (0, 0, 1)}
"""Fibres across the column and the plane: they do not stretch."""


@pytest.mark.parametrize("motion", MOTIONS)
def test_swollen_bodies_come_to_the_balance_with_their_fibres(motion):
    scene = body(motion, *(Fibres(direction, 0.2) for direction in BOTH[motion]))
    found = scene.state(scene.equilibrate()).at((0.4,) * scene.mesh.dim, "J")
    assert found == pytest.approx(rest(motion, 0.2), rel=1e-8)  # homogeneous: Newton's tolerance
    without = scene.state(body(motion, material=replace(TABLE_2, solid=LogNeoHookean())).equilibrate())
    assert abs(without.at((0.4,) * scene.mesh.dim, "J") - found) > 0.1  # control: the ground alone
    if motion in IDLE:
        idle = body(motion, Fibres(IDLE[motion], 1e3))
        point = (0.4,) * scene.mesh.dim
        assert scene.state(idle.equilibrate()).at(point, "J") == pytest.approx(without.at(point, "J"), rel=1e-9)


@pytest.mark.parametrize("motion", ["axisymmetric", "3-d"])
def test_fibres_in_all_directions_in_a_swollen_body(motion):
    """Swollen alike in all directions by J = λ³: µ (λ² − 1) + λ ln J + 8π/3 ξ λ² (λ² − 1) = J (p_D), β = 2."""
    material, xi = reinforced(FibreDistribution(0.05)), 0.05
    scene = body(motion, material=material)
    found = scene.state(scene.equilibrate()).at((0.4,) * scene.mesh.dim, "J")
    assert found == pytest.approx(homogeneous_equilibrium(material, 0.3, "3-d").J, rel=1e-8)  # Newton's tolerance
    m, square = material, found ** (2 / 3)
    cfc = (1 - m.nS0) * m.cfc0 / (found - m.nS0)
    solid = m.mu * (square - 1) + m.lam * log(found) + 8 * pi / 3 * xi * square * (square - 1)
    assert solid == pytest.approx(found * 2 * m.RT * (sqrt(0.3**2 + cfc**2 / 4) - 0.3), rel=1e-7)


def test_checkpoints_and_descriptions_tell_fibres():
    scenes = [
        body("plane strain", Fibres(*settings))
        for settings in [
            ((1, 1, 0), 0.2),
            ((1, 2, 0), 0.2),
            (CF((x, 1, 0)), 0.2),
            (CF((y, 1, 0)), 0.2),
            ((1, 1, 0), 0.2 * x),
        ]
    ]
    assert len({setup_digest(scene)["material"] for scene in scenes}) == len(scenes)
    assert setup_digest(scenes[0]) == setup_digest(body("plane strain", Fibres((1, 1, 0), 0.2)))
    assert "solid: FibreReinforced(" in scenes[0].describe()


class UnsaidSolid(FibreReinforced):
    """The same solid, which does not say that it has a kink."""

    kinked = False


DRAINED = Material(mu=0.1, lam=0.1, nS0=0.25, K=1e-3)


def crossed(charge, solid=FibreReinforced, xi=100.0, **changes):
    """A body bonded to its ground, with two families of fibres a thousand times as stiff: stretched, some go taut."""
    families = [Fibres((1, 0.5, 0), xi), Fibres((1, -0.5, 0), xi)]
    material = replace(TABLE_2 if charge else DRAINED, solid=solid(NeoHookean(), families))
    changes = {"loads": [Traction("top", (0.0, 0.05))], **changes}
    model = {} if charge else {"model": Uncharged()}
    return Scene(
        mesh=rectangle(1, 1, 4, 4), kinematics=PlaneStrain(), material=material, supports=[Roller("bottom", "xy")],
        baths=[Bath("top|right", c=0.3 if charge else None)], **model, **changes,
    )  # fmt: skip


@pytest.mark.parametrize("charge", [False, True])
@pytest.mark.parametrize("pull", [0.05, -0.05])
def test_rest_across_the_kink(charge, pull):
    scene = crossed(charge, loads=[Traction("top", (0.0, pull))])
    state = scene.state(scene.equilibrate(unstable="off"))
    J = state.J(scene.problem.points)
    assert np.isfinite(J).all()
    assert J.min() > DRAINED.nS0
    if not charge:
        with pytest.raises(StepError, match="stalls"):  # control: the kink unsaid
            crossed(charge, UnsaidSolid, loads=[Traction("top", (0.0, pull))]).equilibrate(unstable="off")


def test_a_transient_across_the_kink_comes_to_rest():
    loads = [Traction("top", (0.0, Ramp((0, 0.0), (10, 0.05))))]
    scene = crossed(False, xi=30.0, loads=loads)
    end = scene.run(1e5, Adaptive(1e-2), unstable="off").state
    still = scene.state(scene.equilibrate(1e5, unstable="off"))
    # both solve the same balance; what is left of the transient is below the tolerance of the steps
    assert end.at((0.5, 0.5), "J") == pytest.approx(still.at((0.5, 0.5), "J"), rel=1e-3)


@pytest.mark.parametrize("families", [[(1, 0, 0), (0, 0, 1)], [(1, 0, 0), (0, 0, 1), (0, 1, 0)]])
def test_rest_across_the_kink_under_a_prescribed_displacement(families):
    """An unconfined cylinder shortened by a tenth: radial and hoop fibres go taut, those along the axis slacken."""
    material = replace(DRAINED, solid=FibreReinforced(NeoHookean(), [Fibres(N, 100.0) for N in families]))
    press = Roller("top", "z", displacement=Ramp((0, 0.0), (100, -0.1)))
    scene = Scene(
        mesh=rectangle(1, 1, 2, 2), kinematics=Axisymmetric(), material=material, model=Uncharged(),
        supports=[Roller("left", "r"), Roller("bottom", "z"), press], baths=[Bath("right")],
    )  # fmt: skip
    found = scene.state(scene.equilibrate(100.0)).at((0.4, 0.4), "J")
    low, high = 1.0, 1.1
    while low < (middle := (low + high) / 2) < high:
        low, high = (middle, high) if nominal(np.diag([middle, 0.9, middle]), material)[0, 0] < 0 else (low, middle)
    assert found == pytest.approx(0.9 * low**2, rel=1e-8)  # Newton's tolerance
