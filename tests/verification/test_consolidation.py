"""Consolidation against the series of Terzaghi, Mandel and Cryer.

Loads are 1e-6 µ, so that the finite-strain model departs from the linear theory by less than 1e-6 of the signal. Every case
runs with the steps Δt, Δt/2 and Δt/4: that gives the observed order, and extrapolation leaves an error of Δt³. Lengths are
in mm, times in units of L²/c_v, pressures in units of the load, displacements in units of load/M times the length.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from ngsolve import CF, Grad

from ngswell import (
    Axisymmetric,
    Bath,
    Confined,
    DampedNewton,
    Fixed,
    InputError,
    Material,
    PlaneStrain,
    Platen,
    Probe,
    Roller,
    Scene,
    Symmetry,
    Traction,
    Uncharged,
    column,
    rectangle,
)
from ngswell.closed_forms import consolidation
from ngswell.physics.solid import extra_stress
from studies.limits.verification import quarter_disc

SOLID = {"mu": 0.24, "lam": 0.16, "nS0": 0.25}
MATERIAL = Material(**SOLID, K=1e-3)
M = 0.64  # 2µ + λ [N/mm²]
LOAD = 1e-6 * 0.24
NEWTON = DampedNewton(tolerance=1e-12)  # of µ and of the length: 1e-6 of the signal
FAR = 3e-3
"""What a negative control has to miss a series by, at least: three times the largest error that is allowed below."""


def histories(scene, probes, dT, until):
    """Rows of what `probes` (point, quantity, component, unit) see at multiples of dT[0], computed with steps of dT[1]."""
    scale = 1 / consolidation.consolidation_coefficient(MATERIAL)  # L = 1 mm
    interval, step = dT
    times = np.arange(1, round(until / interval) + 1) * interval
    seen = [Probe(point, quantity, when=list(times * scale)) for point, quantity, *_ in probes]
    scene.run(times[-1] * scale, Fixed(step * scale), seen, newton=NEWTON)
    columns = zip(seen, probes, strict=True)
    return np.array([s.values[q].reshape(len(times), -1)[:, i] / unit for s, (_, q, i, unit) in columns])


@dataclass
class Halved:
    """One scene with three time steps against its series, [quantity, time]."""

    time: np.ndarray
    order: np.ndarray  # of the two finer runs, from their largest errors over time
    limit: np.ndarray  # extrapolated to Δt = 0
    error: np.ndarray  # of the limit


def halved(scene, probes, exact, dT, until, after):
    """Run with dT, dT/2, dT/4 and compare with `exact`(T) at the multiples of dT beyond `after`."""
    T = np.arange(1, round(until / dT) + 1) * dT
    keep = after < T
    coarse, middle, fine = (histories(scene, probes, (dT, dT / n), until)[:, keep] for n in (1, 2, 4))
    reference = exact(T[keep])
    sizes = [np.abs(run - reference).max(axis=1) for run in (middle, fine)]
    limit = (8 * fine - 6 * middle + coarse) / 3
    return Halved(T[keep], np.log2(sizes[0] / sizes[1]), limit, np.abs(limit - reference))


def seconds(T):
    return T / consolidation.consolidation_coefficient(MATERIAL)


# -- the linear limit, and the series themselves -------------------------------------------------------------------------


def test_the_solid_linearises_to_its_lame_constants():
    mesh = rectangle(1, 1, 1, 1)
    strain = np.array([[0.4, 0.3, -0.2], [-0.1, 0.5, 0.1], [0.6, 0.2, -0.3]])
    hooke = 0.24 * (strain + strain.T) + 0.16 * np.trace(strain) * np.eye(3)

    def departure(size):
        F = CF(tuple((np.eye(3) + size * strain).ravel()), dims=(3, 3))
        stress = np.array(extra_stress(F, MATERIAL)(mesh(0.5, 0.5))).reshape(3, 3)
        return np.abs(stress / size - hooke).max()

    assert departure(1e-4) < 1e-4
    assert departure(2e-4) / departure(1e-4) == pytest.approx(2, rel=1e-3)  # the rest is quadratic in the strain


def inverse_laplace(transform, T, terms=24):
    """Talbot's contour with fixed parameters (Abate and Valkó 2004): about 1e-12 for `terms` = 24 in double precision."""
    theta = np.arange(1, terms) * np.pi / terms
    cot = 1 / np.tan(theta)
    r = 2 * terms / (5 * T)
    s, slope = r * theta * (cot + 1j), 1 + 1j * (theta + (theta * cot - 1) * cot)
    return r / terms * (0.5 * np.exp(r * T) * transform(r + 0j).real + (np.exp(T * s) * transform(s) * slope).real.sum())


@pytest.mark.parametrize(("mu", "lam"), [(0.24, 0.16), (0.24, 0.0), (0.1, 3.0)])
def test_series_agree_with_their_laplace_transforms(mu, lam):
    # The transforms come from the boundary-value problems, without roots or residues.
    material = Material(**{**SOLID, "mu": mu, "lam": lam}, K=1e-3)
    modulus, eta, b = 2 * mu + lam, 4 * mu / (2 * mu + lam), mu / (mu + lam)

    def slab(s):
        # p + b p̄ diffuses from (1 + b)/2: p̂ = A [1 − cosh qξ / cosh q], s A = (1 + b)/2 − s b p̄, p̄ = A (1 − tanh q / q)
        q = np.sqrt(s)
        return (1 + b) / 2 / (s * (1 + b * (1 - np.tanh(q) / q)))

    def mandel(s, xi):
        return slab(s) * (1 - np.cosh(np.sqrt(s) * xi) / np.cosh(np.sqrt(s)))

    def shortening(s):
        return (modulus / (2 * mu) / s - slab(s) * (1 - np.tanh(np.sqrt(s)) / np.sqrt(s))) / (2 * mu + 2 * lam)

    def sphere(s):
        q = np.sqrt(s)
        return s * (np.sinh(q) - eta * (q * np.cosh(q) - np.sinh(q)) / s), (q * np.cosh(q) - np.sinh(q)) / s

    transforms = {
        consolidation.terzaghi_pressure: lambda s, xi: (1 - np.cosh(np.sqrt(s) * xi) / np.cosh(np.sqrt(s))) / s,
        consolidation.mandel_pressure: mandel,
        consolidation.cryer_pressure: lambda s, xi: (np.sinh(np.sqrt(s)) - np.sinh(np.sqrt(s) * xi) / xi) / sphere(s)[0],
    }
    unit = 1.3**2 / consolidation.consolidation_coefficient(material)
    for T in (1e-3, 0.02, 0.5):
        for pressure, transform in transforms.items():
            for xi in (1e-6, 0.3, 0.9):
                inverse = inverse_laplace(lambda s, f=transform, xi=xi: f(s, xi), T)
                # 1e-10 of cancellation in sinh(q ξ)/ξ near the centre
                assert pressure(material, 1.0, 1.3, 1.3 * xi, T * unit) == pytest.approx(inverse, abs=1e-9)
        settled = inverse_laplace(lambda s: sphere(s)[1] / sphere(s)[0] / modulus, T)
        assert consolidation.cryer_settlement(material, 1.0, 1.3, T * unit) / 1.3 == pytest.approx(settled, rel=1e-9)
        settled = inverse_laplace(shortening, T)
        assert consolidation.mandel_shortening(material, 1.0, 1.3, T * unit) == pytest.approx(settled, rel=1e-9)
        settled = inverse_laplace(lambda s: np.tanh(np.sqrt(s)) / np.sqrt(s) / s / modulus, T)
        assert consolidation.terzaghi_settlement(material, 1.0, 1.3, T * unit) / 1.3 == pytest.approx(settled, rel=1e-9)


def test_series_begin_undrained():
    assert consolidation.terzaghi_pressure(MATERIAL, 2.0, 1.0, [0.0, 0.5], seconds(1e-4)) == pytest.approx(
        [2.0, 2.0], rel=1e-12
    )
    # What leaves through the boundary layer stiffens the rim by √T and squeezes the middle: shrinking with √T.
    for T in (1e-4, 1e-6):
        assert consolidation.mandel_pressure(MATERIAL, 2.0, 1.0, 0.0, seconds(T)) == pytest.approx(1.0, rel=2 * T**0.5)
        assert consolidation.mandel_shortening(MATERIAL, 2.0, 1.0, seconds(T)) == pytest.approx(
            2.0 / (4 * 0.24), rel=2 * T**0.5
        )
        assert consolidation.cryer_pressure(MATERIAL, 2.0, 1.0, 0.0, seconds(T)) == pytest.approx(2.0, rel=4 * T**0.5)
        assert consolidation.cryer_settlement(MATERIAL, 2.0, 1.0, seconds(T)) == pytest.approx(0.0, abs=4 * T**0.5 / M)


def test_series_refuse_what_they_cannot_mean():
    with pytest.raises(InputError, match="position"):
        consolidation.terzaghi_pressure(MATERIAL, LOAD, 1.0, 1.1, 1.0)
    with pytest.raises(InputError, match="later time"):
        consolidation.cryer_pressure(MATERIAL, LOAD, 1.0, 0.0, [0.0, 1.0])
    with pytest.raises(InputError, match="radius"):
        consolidation.cryer_settlement(MATERIAL, LOAD, -1.0, 1.0)
    with pytest.raises(InputError, match="varies in space"):
        consolidation.mandel_pressure(Material(**SOLID, K=CF(1e-3)), LOAD, 1.0, 0.0, 1.0)


# -- Terzaghi ------------------------------------------------------------------------------------------------------------

HEIGHTS = (0.0, 0.25, 0.5, 0.75)


def terzaghi(cells=20, order=3, flat=True, material=MATERIAL):
    """The column of 1 mm, 1-d or as a strip, suddenly loaded at its drained top; and its probes."""
    if flat:
        geometry = {
            "mesh": column(1.0, cells), "kinematics": Confined(), "supports": [Roller("bottom", "x")],
            "loads": [Traction("top", (-LOAD,))],
        }  # fmt: skip
    else:
        geometry = {
            "mesh": rectangle(0.1, 1.0, 2, cells), "kinematics": PlaneStrain(), "loads": [Traction("top", (0.0, -LOAD))],
            "supports": [Roller("bottom", "y"), Roller("left|right", "x")],
        }  # fmt: skip
    scene = Scene(**geometry, material=material, model=Uncharged(order), baths=[Bath("top")])
    side = () if flat else (0.03,)
    probes = [((*side, z), "p", 0, LOAD) for z in HEIGHTS]
    return scene, [*probes, ((*side, 1.0), "displacement", len(side), -LOAD / M)]


def terzaghi_exact(T, material=MATERIAL):
    """The same rows from the series, at the times that T means for MATERIAL."""
    rows = [consolidation.terzaghi_pressure(material, LOAD, 1.0, z, seconds(T)) / LOAD for z in HEIGHTS]
    return np.array([*rows, consolidation.terzaghi_settlement(material, LOAD, 1.0, seconds(T)) / (LOAD / M)])


@pytest.mark.parametrize("flat", [True, False])
def test_terzaghi(flat):
    run = halved(*terzaghi(flat=flat), terzaghi_exact, 0.02, 0.6, after=0.09)
    assert run.order == pytest.approx(np.ones(5), abs=0.1)
    # Budget: Δt³ with the sudden load five steps ago 6e-5; quadratic p on 20 cells below 1e-6; finite strain 2e-7.
    assert run.error.max() < 1e-4
    # Negative controls: a c_v one percent off, and one with the bulk modulus in place of M.
    for K in (1.01e-3, 1e-3 * (0.16 + 2 / 3 * 0.24) / M):
        assert np.abs(run.limit - terzaghi_exact(run.time, Material(**SOLID, K=K))).max() > FAR


def test_terzaghi_in_space():
    # p of order 1 and the settlement converge with h² at the nodes.
    coarse, fine = (halved(*terzaghi(n, order=2), terzaghi_exact, 0.01, 0.3, after=0.19).error.max(axis=1) for n in (4, 8))
    assert np.log2(coarse / fine) == pytest.approx(np.full(5, 2.0), abs=0.3)


def test_bath_below_the_load_is_the_load():
    # Incompressible constituents: no load and suction at −load behind a porous plate, with p counted from there.
    scene, probes = terzaghi()
    loaded = histories(scene, probes, (0.02, 0.02), 0.2)
    sucked = Scene(
        mesh=column(1.0, 20), kinematics=Confined(), material=MATERIAL, model=Uncharged(3),
        supports=[Roller("bottom", "x")], baths=[Bath("top", P=-LOAD, porous_plate=True)], initial=(None, 0.0),
    )  # fmt: skip
    shifted = histories(sucked, probes, (0.02, 0.02), 0.2) + np.array([[1.0]] * 4 + [[0.0]])
    assert shifted == pytest.approx(loaded, abs=1e-6)  # Newton's tolerance over the load, finite strain


# -- Mandel --------------------------------------------------------------------------------------------------------------


PLACES = (0.0, 0.5, 0.8)


def mandel(cells=16, plate=True):
    """A quarter of the slab, 1 × 1 mm, drained at the right; probes of p and of the plate above the middle and the rim."""
    platens = [Platen("top", force=-LOAD)] if plate else []
    scene = Scene(
        mesh=rectangle(1.0, 1.0, cells, 2), kinematics=PlaneStrain(), material=MATERIAL, model=Uncharged(3),
        supports=[Symmetry("left"), Symmetry("bottom"), *platens], baths=[Bath("right")],
        loads=[] if plate else [Traction("top", (0.0, -LOAD))],
    )  # fmt: skip
    probes = [((x, 0.4), "p", 0, LOAD) for x in PLACES]
    return scene, [*probes, *(((x, 1.0), "displacement", 1, -LOAD / M) for x in (0.0, 1.0))]


def mandel_exact(T):
    rows = [consolidation.mandel_pressure(MATERIAL, LOAD, 1.0, x, seconds(T)) / LOAD for x in PLACES]
    return np.array([*rows, *[consolidation.mandel_shortening(MATERIAL, LOAD, 1.0, seconds(T)) / (LOAD / M)] * 2])


def test_mandel():
    run = halved(*mandel(), mandel_exact, 0.01, 0.4, after=0.045)
    assert run.order == pytest.approx(np.ones(5), abs=0.1)
    # Budget, found by refining: Δt³ with the sudden load five steps ago 4e-5, later 3e-6; 16 cells 2e-6.
    assert run.error.max() < 1e-4
    assert run.error[:, run.time > 0.15].max() < 1e-5
    assert (run.limit[3] == run.limit[4]).all()  # it stays plane
    # Mandel and Cryer's effect: the pressure of the middle first rises, from load/2, and then falls.
    middle, exact = run.limit[0], mandel_exact(run.time)[0]
    peak = int(np.argmax(middle))
    assert 0 < peak == np.argmax(exact)
    assert middle[peak] > 1.08 * 0.5
    assert middle[-1] < 0.8 * 0.5


def test_mandel_needs_the_plate():
    # Negative control: under the same load without a plate.
    assert (halved(*mandel(8, plate=False), mandel_exact, 0.02, 0.3, after=0.09).error.max(axis=1) > FAR).all()


# -- Cryer ---------------------------------------------------------------------------------------------------------------


def cryer(refinements=1, order=4, kinematics=None):
    """The sphere, sucked by its bath instead of loaded; probes of p at the centre and at half the radius on the axis, on the
    diagonal and at the bottom, and of the surface's displacement at the pole and at the equator."""
    mesh = quarter_disc(0.5)
    for _ in range(refinements):
        mesh.Refine()
    scene = Scene(
        mesh=mesh.Curve(order), kinematics=kinematics or Axisymmetric(), material=MATERIAL,
        model=Uncharged(order), supports=[Roller("axis", "r"), Roller("bottom", "z")],
        baths=[Bath("surface", P=-LOAD, porous_plate=True)], initial=(None, 0.0),
    )  # fmt: skip
    places = ((0.0, 0.0), (0.0, 0.5), (0.125**0.5, 0.125**0.5), (0.5, 0.0))
    probes = [(place, "p", 0, LOAD) for place in places]
    return scene, [*probes, ((0.0, 1.0), "displacement", 1, -LOAD / M), ((1.0, 0.0), "displacement", 0, -LOAD / M)]


def cryer_exact(T):
    """The same rows from the series; p as it is computed, counted from no load instead of from the bath."""
    rows = [consolidation.cryer_pressure(MATERIAL, LOAD, 1.0, r, seconds(T)) / LOAD - 1 for r in (0.0, 0.5, 0.5, 0.5)]
    return np.array([*rows, *[consolidation.cryer_settlement(MATERIAL, LOAD, 1.0, seconds(T)) / (LOAD / M)] * 2])


def test_cryer():
    run = halved(*cryer(), cryer_exact, 0.01, 0.2, after=0.045)
    assert run.order == pytest.approx(np.ones(6), abs=0.1)
    # Budget, found by refining: 20 curved triangles with p of order 3 up to 4e-4; Δt³, the sudden load five steps ago, 4e-4.
    assert run.error.max() < 1e-3
    # Spherical symmetry, which the discretisation does not know: pressures at one radius, displacements of pole and equator.
    assert np.ptp(run.limit[1:4], axis=0).max() < 1e-3
    assert np.abs(run.limit[4] - run.limit[5]).max() < 1e-4
    # Mandel and Cryer's effect: the centre's pressure first rises, by a third of the load, and then falls.
    centre, exact = run.limit[0] + 1, cryer_exact(run.time)[0]
    peak = int(np.argmax(centre))
    assert peak == np.argmax(exact)
    assert centre[peak] > 1.35
    assert centre[-1] < 0.7


def test_cryer_in_space():
    # One time step, meshes refined twice: p of order 1 converges with h², over all probes and times.
    runs = [histories(*cryer(n, order=2), (0.02, 0.02), 0.2)[:, 4:] for n in (1, 2, 3)]
    coarse, fine = (np.linalg.norm(a - b) for a, b in pairwise(runs))
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.4)


class WithoutHoop(Axisymmetric):
    """Axisymmetric with the hoop stretch forgotten."""

    def gradient(self, u):
        g = Grad(u)
        return CF((g[0, 0], g[0, 1], 0.0, g[1, 0], g[1, 1], 0.0, 0.0, 0.0, 0.0), dims=(3, 3))


def test_cryer_needs_the_hoop_stretch():
    run = halved(*cryer(order=3, kinematics=WithoutHoop()), cryer_exact, 0.02, 0.2, after=0.09)
    assert (run.error.max(axis=1) > FAR).all()
    assert (run.order < 0.5).all()  # and smaller steps do not help
