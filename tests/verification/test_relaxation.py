"""Stress relaxation under a prescribed strain against the series of Mow (confined) and Armstrong (unconfined).

Strains are 1e-6, where the finite-strain model departs from the linear one by as much of the force. T = c_v t/L².
"""

import numpy as np
import pytest

from ngswell import (
    Adaptive,
    Axisymmetric,
    Bath,
    Confined,
    InputError,
    Material,
    Ramp,
    Reaction,
    Roller,
    Scene,
    Symmetry,
    Uncharged,
    column,
    rectangle,
)
from ngswell.closed_forms import relaxation
from ngswell.closed_forms.consolidation import consolidation_coefficient

MATERIAL = Material(mu=0.24, lam=0.16, nS0=0.25, K=1e-3)
UNIT = 1 / consolidation_coefficient(MATERIAL)  # s, for L = 1 mm
RAMP = 0.1
T = np.array([0.02, 0.05, 0.1, 0.12, 0.2, 0.5])
STRAIN = 1e-6


def force(scene, until=T, tolerance=1e-5):
    """Force on the top at the times T; compression is positive."""
    top = Reaction("top", when=list(until * UNIT))
    scene.run(until[-1] * UNIT, Adaptive(tolerance), [top], unstable="off")
    return top.values[-len(until) :, -1]


def confined(cells=16):
    return Scene(
        mesh=column(1.0, cells), kinematics=Confined(), material=MATERIAL, model=Uncharged(3), baths=[Bath("top")],
        supports=[Roller("bottom", "x"), Roller("top", "x", Ramp((0, 0.0), (RAMP * UNIT, -STRAIN)))],
    )  # fmt: skip


def unconfined(cells=16, order=3, strain=STRAIN):
    """A cylinder of radius 1 mm, the upper half of 1 mm, between frictionless platens, drained at its side."""
    return Scene(
        mesh=rectangle(1.0, 0.5, cells, 1), kinematics=Axisymmetric(), material=MATERIAL, model=Uncharged(order),
        baths=[Bath("right")],
        supports=[
            Symmetry("left"), Symmetry("bottom"), Roller("top", "z", Ramp((0, 0.0), (RAMP * UNIT, -strain / 2))),
        ],
    )  # fmt: skip


def armstrong(strain=STRAIN, material=MATERIAL):
    return np.pi * relaxation.unconfined_relaxation(material, strain, RAMP * UNIT, 1.0, T * UNIT)


def test_confined():
    exact = relaxation.confined_relaxation(MATERIAL, STRAIN, RAMP * UNIT, 1.0, T * UNIT)
    # Budget: the steps' tolerance 1e-5, the strain 1e-6, p of order 2 on 16 cells 1e-6.
    assert force(confined()) == pytest.approx(exact, rel=1e-5)


def test_unconfined():
    # Budget: the strain 1e-6; refining cells and steps changes no more than that.
    assert force(unconfined()) == pytest.approx(armstrong(), rel=5e-6)
    # Negative controls: a permeability one percent off, the modulus at rest for all times.
    off = Material(mu=0.24, lam=0.16, nS0=0.25, K=1.01e-3)
    assert np.abs(armstrong(material=off) / armstrong() - 1).max() > 1e-4
    assert np.abs(0.576 * np.pi * STRAIN / armstrong() - 1).min() > 1e-2


def test_unconfined_in_space():
    # p of order 1: the force converges with h².
    errors = [np.abs(force(unconfined(cells, order=2)) - armstrong()).max() for cells in (8, 16)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_the_rest_is_finite_strain():
    # The departure from the linear theory is proportional to the strain: 0.93 of it at most.
    small, large = (np.abs(force(unconfined(8, strain=s)) / armstrong(s) - 1).max() for s in (1e-3, 1e-2))
    assert large / small == pytest.approx(10, rel=0.02)
    assert large < 1e-2


def bessel(order, z):
    """I of an integer order and complex argument."""
    theta = (np.arange(400) + 0.5) * np.pi / 400
    return (np.exp(z * np.cos(theta)) * np.cos(order * theta)).mean()


def inverse_laplace(transform, T, terms=24):
    """Talbot's contour with fixed parameters (Abate and Valkó 2004): about 1e-12 for `terms` = 24 in double precision."""
    theta = np.arange(1, terms) * np.pi / terms
    cot = 1 / np.tan(theta)
    r = 2 * terms / (5 * T)
    s, slope = r * theta * (cot + 1j), 1 + 1j * (theta + (theta * cot - 1) * cot)
    values = np.array([transform(point) for point in s])
    return r / terms * (0.5 * np.exp(r * T) * transform(r + 0j).real + (np.exp(T * s) * values * slope).real.sum())


@pytest.mark.parametrize(("mu", "lam"), [(0.24, 0.16), (0.24, 0.0), (0.1, 3.0)])
def test_series_agree_with_their_laplace_transforms(mu, lam):
    # The transforms come from the boundary-value problems, without roots or residues; while the strain rises.
    material, M = Material(mu=mu, lam=lam, nS0=0.25, K=1e-3), 2 * mu + lam
    unit = 1 / consolidation_coefficient(material)

    def plates(s):
        q = np.sqrt(s)
        return (
            2 * mu + mu * (M * q * bessel(0, q) - 4 * mu * bessel(1, q)) / (M * q * bessel(0, q) - 2 * mu * bessel(1, q))
        ) / s**2

    transforms = {
        relaxation.confined_relaxation: lambda s: M * np.sqrt(s) / np.tanh(np.sqrt(s)) / s**2,
        relaxation.unconfined_relaxation: plates,
    }
    for at in (1e-3, 0.02, 0.5):
        for series, transform in transforms.items():
            # the strain rises by 1 in a unit of time
            assert series(material, 1.0, unit, 1.0, at * unit) == pytest.approx(inverse_laplace(transform, at), rel=1e-8)


def test_series_refuse_what_they_cannot_mean():
    for arguments, said in (
        ((1e-3, 1.0, 1.0, [-1.0, 2.0]), "time"),
        ((1e-3, 1.0, 1.0, 1.0 + 1e-6), "so much later"),
        ((1e-3, 0.0, 1.0, 1.0), "duration"),
        ((1e-3, 1.0, np.nan, 1.0), "radius"),
        ((np.inf, 1.0, 1.0, 1.0), "strain"),
    ):
        for series in (relaxation.confined_relaxation, relaxation.unconfined_relaxation):
            with pytest.raises(InputError, match=said):
                series(MATERIAL, *arguments)
