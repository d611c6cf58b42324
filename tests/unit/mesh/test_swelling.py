"""Every cell shape swells homogeneously to the closed form, and is written so."""

from math import pi

import meshio
import numpy as np
import pytest

from ngswell import (
    TABLE_2,
    VTK,
    Adaptive,
    Area,
    Axisymmetric,
    Bath,
    Confined,
    DampedNewton,
    Ledger,
    Penalty,
    PlaneStrain,
    Probe,
    Ramp,
    Roller,
    Scene,
    Spatial,
    box,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.meshes import MESHES, quarter_disc


def swell(mesh, kinematics, supports, boundary, observers=()):
    """A homogeneous body of Table 2 whose charge comes up in a bath of 4.1 mol/l, to rest."""
    scene = Scene(
        mesh=mesh,
        kinematics=kinematics,
        material=TABLE_2,
        supports=supports,
        baths=[Bath(boundary, c=4.1, treatment=Penalty(40.0))],
        charge=Ramp((0, 0.0), (100, 1.0)),
    )
    point = {1: (0.7,), 2: (0.4, 0.3), 3: (0.4, 0.3, 0.2)}[mesh.dim]
    volume, probe, ledger = Area(), Probe(point, "J", "p", "cfc", "c_plus", "nS"), Ledger()
    scene.run(1e6, Adaptive(1e-4), [volume, probe, ledger, *observers], newton=DampedNewton())
    return scene, volume.values, probe.values, ledger


def check_at_rest(volume, values, ledger, motion):
    state = homogeneous_equilibrium(TABLE_2, 4.1, motion)
    assert volume[-1] / volume[0] == pytest.approx(state.J, rel=1e-8)
    for name, value in (("J", state.J), ("p", state.p), ("cfc", state.cfc), ("c_plus", state.c), ("nS", state.nS)):
        # A homogeneous state lies in every space: what is left is the relaxation still to come.
        assert values[name][-1] == pytest.approx(value, rel=1e-7)
    # Contents and fluxes are sums over the same test functions: what is left is round-off of p times penalty times step,
    # which grows to 1e-8 in steps of 1e5 s. While the body takes up fluid, within 200 s, it is below 1e-11.
    early = ledger.time <= 200
    for held, left in ((ledger.fluid, ledger.fluid_left), (ledger.cations, ledger.cations_left)):
        (left,) = left.values()
        assert np.abs(held - held[0] + left)[early].max() < 1e-11 * held.max()
        assert np.abs(held - held[0])[early].max() > 1e-3 * held.max()
    return state


@pytest.mark.parametrize("name", MESHES)
def test_swelling_comes_to_the_closed_form(name, tmp_path):
    mesh = MESHES[name][0](tmp_path)
    kinematics, supports, boundary, motion = {
        1: (Confined(), [Roller("bottom", "x")], "top", "confined"),
        2: (PlaneStrain(), [Roller("left", "x"), Roller("bottom", "y")], "top|right", "plane strain"),
        3: (Spatial(), [Roller("left", "x"), Roller("front", "y"), Roller("bottom", "z")], "top|right|back", "3-d"),
    }[mesh.dim]
    _, volume, values, ledger = swell(mesh, kinematics, supports, boundary)
    check_at_rest(volume, values, ledger, motion)


@pytest.mark.parametrize("quads", [False, True])
def test_curved_quarter_disc_in_plane_strain(quads):
    mesh = quarter_disc(quads=quads)
    supports = [Roller("left", "x"), Roller("bottom", "y")]
    _, volume, values, ledger = swell(mesh, PlaneStrain(), supports, "rim")
    # Sides curved with the displacement's order: coordinates, and their multiples, lie in its space.
    check_at_rest(volume, values, ledger, "plane strain")


@pytest.mark.parametrize("name", ["quarter disc", "quads", "triangles", "gmsh mixed"])
def test_axisymmetric(name, tmp_path):
    mesh = quarter_disc() if name == "quarter disc" else MESHES[name][0](tmp_path)
    boundary = "rim" if name == "quarter disc" else "top|right"
    _, volume, values, ledger = swell(mesh, Axisymmetric(), [Roller("left", "r"), Roller("bottom", "z")], boundary)
    check_at_rest(volume, values, ledger, "3-d")
    exact = 2 * pi / 3 if name == "quarter disc" else 4 * pi
    # The hemisphere within its sides' error, the cylinder exactly.
    assert volume[0] == pytest.approx(exact, rel=2e-3 if name == "quarter disc" else 1e-12)


@pytest.mark.parametrize("kind", ["3-d", "axisymmetric", "plane strain"])
def test_vtk_reads_back(kind, tmp_path):
    if kind == "3-d":
        mesh, kinematics = box(2.0, 1.0, 3.0, 1, 1, 1, "prisms"), Spatial()
        supports, boundary = [Roller("left", "x"), Roller("front", "y"), Roller("bottom", "z")], "top|right|back"
    else:
        mesh, kinematics = quarter_disc(quads=True), Axisymmetric() if kind == "axisymmetric" else PlaneStrain()
        x, y = kinematics.directions
        supports, boundary = [Roller("left", x), Roller("bottom", y)], "rim"
    series = VTK(tmp_path / "body", when=[0.0, 1e6])
    swell(mesh, kinematics, supports, boundary, [series])
    state = homogeneous_equilibrium(TABLE_2, 4.1, "plane strain" if kind == "plane strain" else "3-d")
    files = sorted(tmp_path.glob("body*.vtu"), key=lambda file: file.stat().st_mtime_ns)
    assert len(files) == 2
    data = meshio.read(files[-1])
    fields = data.point_data
    assert all(np.isfinite(values).all() for values in fields.values())
    # Written in double precision: what is left is the relaxation still to come.
    assert fields["J"] == pytest.approx(state.J, rel=1e-9)
    assert fields["p"] == pytest.approx(state.p, rel=1e-9)
    stretch = state.J ** (1 / (2 if kind == "plane strain" else 3))
    assert fields["displacement"] == pytest.approx((stretch - 1) * data.points, abs=1e-9)
    assert data.points[:, 2].max() == (3.0 if kind == "3-d" else 0.0)
