"""The same scene in every dimension, and in every frame."""

from math import cos, pi, radians, sin

import numpy as np
import pytest
from ngsolve import Integrate, Mesh, specialcf
from ngsolve.meshes import MakeStructured2DMesh, MakeStructured3DMesh

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Area,
    Axisymmetric,
    Bath,
    Confined,
    Fixed,
    InputError,
    Ledger,
    Penalty,
    Pin,
    PlaneStrain,
    Probe,
    Ramp,
    Roller,
    Scene,
    Spatial,
    Traction,
    column,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import FALLING, P0


def bar(n: int) -> Mesh:
    """A bar of hexahedra; boundaries back and front across x, left and right across y, bottom and top."""
    return MakeStructured3DMesh(hexes=True, nx=1, ny=1, nz=n, mapping=lambda s, t, r: (0.02 * s, 0.02 * t, 0.5 * r))


def test_column_as_segment_strip_bar_and_cylinder():
    """One transient, four kinematics, the same elements along the column: equal to Newton's tolerance."""
    cells = 8
    scenes = {
        "segment": (column(0.5, cells), Confined(), [Roller("bottom", "x")], (-P0,), (0.5,)),
        "strip": (
            rectangle(0.02, 0.5, 1, cells),
            PlaneStrain(),
            [Roller("left|right", "x"), Roller("bottom", "y")],
            (0.0, -P0),
            (0.01, 0.5),
        ),
        "cylinder": (
            rectangle(0.02, 0.5, 1, cells),
            Axisymmetric(),
            [Roller("left|right", "r"), Roller("bottom", "z")],
            (0.0, -P0),
            (0.01, 0.5),
        ),
        "bar": (
            bar(cells),
            Spatial(),
            [Roller("back|front", "x"), Roller("left|right", "y"), Roller("bottom", "z")],
            (0.0, 0.0, -P0),
            (0.01, 0.01, 0.5),
        ),
    }
    ends = {}
    for name, (mesh, kinematics, supports, load, top) in scenes.items():
        probe, ledger = Probe(top, "J", "p", "c_plus"), Ledger()
        scene = Scene(
            mesh=mesh,
            kinematics=kinematics,
            material=TABLE_1,
            supports=supports,
            baths=[Bath("top", c=FALLING, treatment=Penalty(1.0))],
            loads=[Traction("top", load)],
        )
        scene.run(60.0, Fixed(10.0), [probe, ledger])
        ends[name] = np.array([probe.values[q] for q in ("J", "p", "c_plus")])
        assert max(ledger.imbalance().values()) < 1e-10
    for name in ("strip", "cylinder", "bar"):
        assert ends[name] == pytest.approx(ends["segment"], abs=1e-9), name


SWELLING = {
    "material": TABLE_2,
    "charge": Ramp((0, 0.0), (100, 1.0)),
    "initial": (4.1, 0.0),
}


@pytest.mark.parametrize("inner", [0.0, 0.5])
def test_a_free_cylinder_swells_like_a_block(inner):
    # Three free directions: the 3-d closed form, on the axis and away from it.
    mesh = MakeStructured2DMesh(quads=True, nx=2, ny=2, mapping=lambda s, t: (inner + s, t))
    supports = [Roller("bottom", "z")] + ([Roller("left", "r")] if inner == 0.0 else [])
    baths = [Bath("top|right" if inner == 0.0 else "top|right|left", c=4.1)]
    scene = Scene(mesh=mesh, kinematics=Axisymmetric(), supports=supports, baths=baths, **SWELLING)
    state = scene.state(scene.equilibrate(100.0))
    J = state.J(scene.problem.points).ravel()
    closed = homogeneous_equilibrium(TABLE_2, 4.1, "3-d").J
    assert pytest.approx(np.full_like(J, closed), rel=1e-9) == J
    hoop = state.F[2, 2](mesh(inner, 0.5))  # on the axis u_r/r is its limit
    assert hoop == pytest.approx(closed ** (1 / 3), rel=1e-9)


def ring_volume_axisymmetric(n):
    mesh = MakeStructured2DMesh(quads=True, nx=n, ny=1, mapping=lambda s, t: (0.5 + 0.5 * s, 0.5 * t))
    scene = Scene(
        mesh=mesh,
        kinematics=Axisymmetric(),
        supports=[Roller("bottom|top", "z")],
        baths=[Bath("left|right", c=4.1, treatment=Penalty(relative=1e3))],
        **SWELLING,
    )
    volume = Area()
    scene.run(100.0, Fixed(20.0), [volume])
    return volume.values[-1]


def test_axisymmetric_ring_and_a_quarter_of_it_in_3d():
    """Radial transient of a ring between plates: the 3-d quarter comes closer with the order of its facets, 2."""
    reference = ring_volume_axisymmetric(16) * 0.25
    errors = []
    for n in (2, 4):
        mesh = MakeStructured3DMesh(
            hexes=True, nx=n, ny=n, nz=1,
            mapping=lambda s, t, r: ((0.5 + 0.5 * s) * cos(t * pi / 2), (0.5 + 0.5 * s) * sin(t * pi / 2), 0.5 * r),
        )  # fmt: skip
        kinds = {}
        for name in sorted(set(mesh.GetBoundaries())):
            region = mesh.Boundaries(name)
            normal = [Integrate(specialcf.normal(3)[i], mesh, definedon=region) for i in range(3)]
            straight = Integrate(1.0, mesh, definedon=region) - np.linalg.norm(normal)
            axis = int(np.argmax(np.abs(normal)))
            kinds[name] = "xyz"[axis] if straight < 1e-9 else "bath"
        scene = Scene(
            mesh=mesh,
            kinematics=Spatial(),
            supports=[Roller(name, kind) for name, kind in kinds.items() if kind != "bath"],
            baths=[Bath("|".join(n for n, k in kinds.items() if k == "bath"), c=4.1, treatment=Penalty(relative=1e3))],
            **SWELLING,
        )
        volume = Area()
        scene.run(100.0, Fixed(20.0), [volume])
        errors.append(abs(volume.values[-1] / reference - 1))
    assert np.log2(errors[0] / errors[1]) > 1.6
    assert errors[1] < 0.03


def turned(angle):
    c, s = cos(angle), sin(angle)

    def place(a, b):
        return (0.6 * a * c - 0.4 * b * s, 0.6 * a * s + 0.4 * b * c)

    mesh = MakeStructured2DMesh(quads=True, nx=3, ny=2, mapping=place)
    scene = Scene(
        mesh=mesh,
        kinematics=PlaneStrain(),
        material=TABLE_2,
        charge=Ramp((0, 0.0), (100, 1.0)),
        supports=[Pin(place(0, 0), "xy"), Pin(place(1, 0), "y")],
        baths=[Bath("top|left", c=Ramp((100, 4.1), (150, 2.0)), treatment=Penalty(1.0))],
    )
    area, corner = Area(), Probe(place(1, 1), "J", "p", "c_plus", "cfc")
    state = scene.run(200.0, Fixed(25.0), [area, corner]).state
    u = state.u
    ends = [np.array(place(*q)) + np.array(u(mesh(*place(*q)))) for q in ((0, 0), (1, 1), (0, 1))]
    lengths = [np.linalg.norm(ends[0] - ends[1]), np.linalg.norm(ends[1] - ends[2])]
    stress = np.linalg.eigvalsh(np.array(state.outputs()["stress"](mesh(*place(0.3, 0.6)))).reshape(3, 3))
    return np.concatenate([area.values, *corner.values.values(), lengths, stress])


@pytest.mark.parametrize("angle", [radians(30), radians(-40)])
def test_objectivity(angle):
    # Pins take out the rigid motion only, so every invariant of a turned scene is that of the scene itself.
    assert turned(angle) == pytest.approx(turned(0.0), rel=1e-9)


def test_refusals():
    crossing = MakeStructured2DMesh(quads=True, nx=2, ny=2, mapping=lambda s, t: (s - 0.5, t))
    with pytest.raises(InputError, match="crosses the axis"):
        Scene(
            mesh=crossing, kinematics=Axisymmetric(), supports=[Roller("bottom", "z")], material=TABLE_1, initial=(1.0, 0.0)
        )
    with pytest.raises(InputError, match="touches the axis"):
        Scene(
            mesh=rectangle(1, 1, 2, 2), kinematics=Axisymmetric(), supports=[Roller("bottom", "z")], material=TABLE_1,
            initial=(1.0, 0.0),
        )  # fmt: skip
    with pytest.raises(InputError, match="translate in z"):
        Scene(
            mesh=rectangle(1, 1, 2, 2), kinematics=Axisymmetric(), supports=[Roller("left", "r")], material=TABLE_1,
            initial=(1.0, 0.0),
        )  # fmt: skip
    with pytest.raises(InputError, match="3-d mesh"):
        Scene(mesh=rectangle(1, 1, 2, 2), kinematics=Spatial(), material=TABLE_1, initial=(1.0, 0.0))


def test_volume_of_a_cylinder():
    # The weight 2πr makes volumes of areas.
    mesh = rectangle(0.7, 0.3, 3, 2)
    scene = Scene(
        mesh=mesh, kinematics=Axisymmetric(), supports=[Roller("left", "r"), Roller("bottom", "z")], material=TABLE_1,
        baths=[Bath("top", c=0.1)],
    )  # fmt: skip
    volume = Area()
    scene.run(1.0, Adaptive(1e-1), [volume])
    assert volume.values[0] == pytest.approx(pi * 0.7**2 * 0.3, rel=1e-12)
