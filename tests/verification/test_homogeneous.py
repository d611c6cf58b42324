"""Homogeneous equilibria over baths and charges, and Donnan equilibrium of gels that are not homogeneous."""

import numpy as np
import pytest
from ngsolve import Integrate, x, y
from ngsolve.meshes import MakeStructured3DMesh

from ngswell import (
    Bath,
    Concentration,
    Confined,
    LocalDonnan,
    Material,
    Penalty,
    PlaneStrain,
    Roller,
    Scene,
    Solid,
    Symmetry,
    column,
    laws,
    rectangle,
)
from ngswell.analytic import homogeneous_equilibrium


def gel(cfc0):
    return Material(mu=0.12, lam=0.02, nS0=0.25, cfc0=cfc0, D_plus=5e-4, D_minus=8e-4, K=1.07e-3)


def body(motion, cfc0, bath, model):
    mesh, kinematics, supports, wet = {
        "confined": (column(1.0, 2), Confined(), [Roller("bottom", "x")], "top"),
        "plane strain": (rectangle(1, 1, 1, 1), PlaneStrain(), [Symmetry("left"), Symmetry("bottom")], "top|right"),
        "3-d": (
            MakeStructured3DMesh(hexes=True, nx=1),
            Solid(),
            [Roller("back", "x"), Roller("left", "y"), Roller("bottom", "z")],
            "front|right|top",
        ),
    }[motion]
    return Scene(
        mesh=mesh,
        kinematics=kinematics,
        material=gel(cfc0),
        supports=supports,
        baths=[Bath(wet, c=bath)],
        **({} if model is None else {"model": model}),
    )


@pytest.mark.parametrize("motion", ["confined", "plane strain", "3-d"])
@pytest.mark.parametrize("model", [None, LocalDonnan()])
def test_over_baths_and_charges(motion, model):
    """Baths over nearly seven decades, charges from none to 1 mol/l: up to thirtyfold swelling, to Newton's tolerance."""
    largest = 0.0
    for cfc0 in (0.0, 0.01, 0.2, 1.0):
        for bath in (1e-6, 1e-3, 0.15, 5.0):
            scene = body(motion, cfc0, bath, model)
            scene.problem.restore(scene.equilibrate())
            closed = homogeneous_equilibrium(gel(cfc0), bath, motion)
            J = scene.problem.state.J(scene.problem._quadrature).ravel()
            assert pytest.approx(np.full_like(J, closed.J), rel=1e-8) == J, (cfc0, bath)
            where = scene.mesh(*(0.5,) * scene.mesh.dim)
            outputs = scene.problem.state.outputs()
            for name, value in (("p", closed.p), ("c_plus", closed.c), ("cfc", closed.cfc), ("nS", closed.nS)):
                assert outputs[name](where) == pytest.approx(value, rel=1e-7, abs=1e-9), (name, cfc0, bath)
            largest = max(largest, closed.J)
    assert largest > {"confined": 3, "plane strain": 5, "3-d": 20}[motion]


LAYERED = Material(  # even in x and y: smooth across the symmetry planes
    mu=0.12 * (1 + y * y),
    lam=0.02,
    nS0=0.2 + 0.1 * x * x,
    cfc0=0.3 + 0.3 * x * x * y * y,
    D_plus=5e-4,
    D_minus=8e-4,
    K=1.07e-3,
)


def unrest(n, order=2):
    """Deviations from uniform c̃ and hydraulic pressure, and the seepage that is left, of a gel at rest (L2 norms)."""
    scene = Scene(
        mesh=rectangle(1.0, 1.0, n, n),
        kinematics=PlaneStrain(),
        material=LAYERED,
        model=Concentration(order=order),
        supports=[Symmetry("left"), Symmetry("bottom")],
        baths=[Bath("top|right", c=1.0, treatment=Penalty(relative=1e3))],
        initial=(1.0, 0.0),
    )
    scene.problem.restore(scene.equilibrate())
    out = scene.problem.state.outputs()
    salt = (out["c_plus"] * out["c_minus"] - 1.0) ** 2
    pressure = (out["hydraulic_pressure"] / LAYERED.RT + 2.0) ** 2
    seepage = out["seepage"][0] ** 2 + out["seepage"][1] ** 2
    return np.sqrt([Integrate(error, scene.mesh, order=10) for error in (salt, pressure, seepage)])


@pytest.mark.parametrize("order", [2, 3])
def test_donnan_equilibrium_with_varying_charge_and_stiffness(order):
    """c₊ c₋ = c̄² and P = P̄ − 2 Rθ c̄ everywhere and no seepage, to the orders of p and c (k) and of their gradients."""
    coarse, fine = unrest(4, order), unrest(8, order)
    orders = np.log2(coarse / fine)
    assert orders[0] > order - 0.3
    assert orders[1] > order - 0.3
    assert orders[2] > order - 1 - 0.3
    assert fine[0] < 1e-3


def test_the_printed_drive_flows_at_rest(monkeypatch):
    """Negative control: with the factor x of (19) as printed the same gel does not come to Donnan equilibrium."""
    proper = laws.transport

    def printed(material, nF, c, cfc, drive, grad_c, grad_cfc):
        osmolarity = 2 * c - cfc
        share = osmolarity / (osmolarity + 55.8)
        return proper(material, nF, c, cfc, drive - (1 - share) * material.RT * (2 * grad_c - grad_cfc), grad_c, grad_cfc)

    right = unrest(8)
    monkeypatch.setattr(laws, "transport", printed)
    wrong_coarse, wrong = unrest(4), unrest(8)
    for kind in (1, 2):  # hydraulic pressure and seepage
        assert wrong[kind] > 30 * right[kind]
        assert abs(np.log2(wrong_coarse[kind] / wrong[kind])) < 0.1  # refinement does not help
