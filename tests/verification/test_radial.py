"""Radial motions against closed forms, against the same scene on a mesh of higher dimension, and their order."""

from math import pi

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Area,
    Axisymmetric,
    Bath,
    Concentration,
    Confined,
    Cylindrical,
    DampedNewton,
    Fixed,
    InputError,
    Integral,
    Ledger,
    LocalDonnan,
    Material,
    Nitsche,
    Outflow,
    Penalty,
    Potential,
    Pressure,
    Probe,
    Ramp,
    Reaction,
    Roller,
    Scene,
    Spherical,
    Stability,
    Symmetry,
    Traction,
    Uncharged,
    column,
    ray,
    rectangle,
)
from ngswell.closed_forms import consolidation
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium

DRAINED = Material(mu=0.24, lam=0.16, nS0=0.25, K=1e-3)
EXACT = DampedNewton(tolerance=1e-12)  # signals of 1e-6
MOTIONS = [(Cylindrical(), "plane strain"), (Spherical(), "3-d")]


def body(kinematics, inner=0.0, outer=1.0, cells=4, grade=None, **changes) -> Scene:
    """A body that is free outside, and inside where it is hollow."""
    parts = {
        "material": TABLE_2,
        "supports": [] if inner else [Symmetry("inner")],
        "baths": [Bath("inner|outer" if inner else "outer", c=0.3)],
    }
    return Scene(mesh=ray(inner, outer, cells, grade=grade), kinematics=kinematics, **parts | changes)


# -- homogeneous swelling ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [Potential(), Concentration(), LocalDonnan()], ids=str)
@pytest.mark.parametrize("inner", [0.0, 0.5])
@pytest.mark.parametrize(("kinematics", "motion"), MOTIONS, ids=str)
def test_a_free_body_swells_alike_everywhere(kinematics, motion, inner, model):
    scene = body(kinematics, inner, model=model, charge=Ramp((0, 0.0), (100, 1.0)), initial=(0.3, 0.0))
    state = scene.state(scene.equilibrate(100.0))
    closed, found = homogeneous_equilibrium(TABLE_2, 0.3, motion), state.J(scene.problem.points).ravel()
    # u is linear in r and lies in the space: what is left is round-off.
    assert found == pytest.approx(np.full_like(found, closed.J), rel=1e-9)
    stretch = closed.J ** (1 / kinematics.power)
    assert state.at((1.0,), "displacement") == pytest.approx(stretch - 1, rel=1e-9)
    assert state.F[1, 1](scene.mesh(inner)) == pytest.approx(stretch, rel=1e-9)  # at r = 0 the limit of u/r
    assert state.at((inner,), "stress") == pytest.approx(np.diag([0.0, 0.0, stress_across(state)]).ravel(), abs=1e-9)


def stress_across(state):
    """Of plane strain; none where all directions are free."""
    return 0.0 if state.kinematics.power == 3 else state.at((0.7,), "stress")[8]


def test_amounts_have_their_measures():
    for kinematics, volume, surface, units in (
        (Cylindrical(), pi * (1 - 0.25), 2 * pi, ("mm²", "mm")),
        (Spherical(), 4 / 3 * pi * (1 - 0.125), 4 * pi, ("mm³", "mm²")),
    ):
        whole, outside = Area(), Integral(boundary="outer")
        scene = body(kinematics, 0.5, charge=Ramp((0, 0.0), (100, 1.0)), initial=(0.3, 0.0))
        scene.equilibrate(100.0, observers=[whole, outside])
        J = homogeneous_equilibrium(TABLE_2, 0.3, "3-d" if kinematics.power == 3 else "plane strain").J
        assert whole.values[-1] == pytest.approx(volume * J, rel=1e-9)
        assert outside.values[-1] == pytest.approx(surface * J ** ((kinematics.power - 1) / kinematics.power), rel=1e-9)
        assert (whole.unit("value"), outside.unit("value")) == units


# -- Lamé's hollow cylinder and sphere ---------------------------------------------------------------------------------

A, B, P = 0.5, 1.0, 1e-7  # mm, mm, N/mm²: strains of 1e-6


def lame(kinematics, r):
    """Displacement [mm] under a pressure P inside, drained, at small strain (G. Lamé 1852)."""
    mu, lam = DRAINED.mu, DRAINED.lam
    if kinematics == Cylindrical():
        factor = P * A**2 / (B**2 - A**2)
        return factor * (r / (2 * (lam + mu)) + B**2 / (2 * mu * r))
    factor = P * A**3 / (B**3 - A**3)
    return factor * (r / (3 * lam + 2 * mu) + B**3 / (4 * mu * r**2))


def pressed_inside(kinematics, cells, order=2, load=None):
    """Largest error of the displacement at the vertices of a drained body, relative to the largest displacement."""
    scene = body(
        kinematics, A, B, cells, material=DRAINED, model=Uncharged(order), baths=[Bath("inner|outer")],
        loads=[load or Traction("inner", (P,))],
    )  # fmt: skip
    state = scene.state(scene.equilibrate(newton=EXACT))
    r = np.linspace(A, B, cells + 1)
    found = np.array([state.at((at,), "displacement") for at in r])
    return np.abs(found / lame(kinematics, r) - 1).max()


@pytest.mark.parametrize("kinematics", [Cylindrical(), Spherical()], ids=str)
@pytest.mark.parametrize("order", [2, 3])
def test_lame(kinematics, order):
    coarse, fine = (pressed_inside(kinematics, cells, order) for cells in (4, 8))
    # Values at vertices converge with h to the power 2k; strains of 1e-6 depart from the linear theory by as much.
    assert coarse - 2e-6 < (3e-3 if order == 2 else 1e-4)
    assert np.log2(coarse / fine) > 2 * order - 0.7 or fine < 3e-6
    follower = pressed_inside(kinematics, 8, order, Pressure("inner", P))
    assert follower == pytest.approx(fine, abs=3e-6)


def test_lame_notices_a_wrong_hoop_stretch(monkeypatch):
    monkeypatch.setattr(Spherical, "gradient", Cylindrical.gradient)
    assert pressed_inside(Spherical(), 8) > 0.1


# -- transients --------------------------------------------------------------------------------------------------------


def exchanged(scene, outer, inside):
    """Histories of a body whose bath is diluted, and what its ledger leaves."""
    probes = [Probe(outer, "J", "displacement", "p", "c_plus"), Probe(inside, "J", "p", "c_plus")]
    ledger, outflow = Ledger(), Outflow("right" if len(outer) == 2 else "outer", outer)
    scene.run(200.0, Fixed(20.0), [*probes, ledger, outflow], newton=DampedNewton())
    rows = [np.ravel(probe.values[name][:, 0] if probe.values[name].ndim > 1 else probe.values[name])
            for probe in probes for name in probe.values]  # fmt: skip
    rows += [outflow.fluid, outflow.cations, outflow.fluid_at[:, 0], outflow.cations_at[:, 0]]
    return np.array(rows), max(ledger.imbalance().values())


DILUTED = Ramp((0, 0.15), (50, 0.1))


@pytest.mark.parametrize("inner", [0.0, 0.5])
@pytest.mark.parametrize(
    ("model", "treatment"),
    [(Potential(), None), (Concentration(), Penalty(relative=1e4)), (Concentration(), Nitsche())],
    ids=str,
)
def test_a_cylinder_is_the_axisymmetric_one_between_plates(model, treatment, inner):
    """The same elements along r, in one layer: equal to Newton's tolerance."""
    h = 0.3  # mm
    mesh = rectangle(1.0 - inner, h, 4, 1)
    for vertex in mesh.ngmesh.Points():
        vertex[0] += inner
    flat = Scene(
        mesh=mesh, kinematics=Axisymmetric(), material=TABLE_1, model=model, initial=(0.15, 0.0),
        supports=[Roller("top|bottom", "z"), *([] if inner else [Roller("left", "r")])],
        baths=[Bath("right", c=DILUTED, treatment=treatment)],
    )  # fmt: skip
    line = body(
        Cylindrical(), inner, material=TABLE_1, model=model, baths=[Bath("outer", c=DILUTED, treatment=treatment)],
    )  # fmt: skip
    flat, line = (
        exchanged(scene, *places) for scene, places in ((flat, ((1.0, 0.1), (0.75, 0.1))), (line, ((1.0,), (0.75,))))
    )
    flat[0][-4:-2] /= h  # amounts per millimetre of its length
    scale = np.abs(flat[0][:, 1:]).max(axis=1, keepdims=True)
    assert (line[0] / scale)[:, 1:] == pytest.approx((flat[0] / scale)[:, 1:], abs=1e-6)
    assert line[1] < 1e-7
    assert np.ptp(line[0][1]) > 1e-3  # mm: it moves


def cryer(cells, order):
    """Largest errors of p at the centre and at half the radius, and of the surface's displacement."""
    load, radius = 1e-6 * DRAINED.mu, 1.0
    scene = body(
        Spherical(), 0.0, radius, cells, {"outer": 10}, material=DRAINED, model=Uncharged(order),
        baths=[Bath("outer", P=-load, porous_plate=True)], initial=(None, 0.0),
    )  # fmt: skip
    unit = radius**2 / consolidation.consolidation_coefficient(DRAINED)
    when = list(np.array([0.02, 0.05, 0.1, 0.2]) * unit)
    places = (0.0, 0.5)
    probes = [Probe((r,), "p", when=when) for r in places]
    surface = Probe((radius,), "displacement", when=when)
    scene.run(when[-1], Adaptive(1e-5), [*probes, surface], newton=EXACT)
    errors = [
        probe.values["p"] / load - (consolidation.cryer_pressure(DRAINED, load, radius, r, when) / load - 1)
        for probe, r in zip(probes, places, strict=True)
    ]
    settlement = consolidation.cryer_settlement(DRAINED, load, radius, when)
    return [np.abs(error).max() for error in errors] + [np.abs(surface.values["displacement"] / -settlement - 1).max()]


def test_cryer():
    coarse, fine = cryer(8, 3), cryer(16, 3)
    # Measured 4.7e-4, 3.8e-5, 1.5e-6 on 16 graded cells; the steps leave 2e-5 (32 cells: 3.4e-5, 2.1e-5, 1.3e-6).
    assert (np.array(fine) < [6e-4, 6e-5, 5e-6]).all()
    assert coarse[0] / fine[0] > 8  # p of order 2: h³ or better


def swollen(kinematics, cells, order=2):
    scene = body(
        kinematics, 0.2, 1.0, cells, material=TABLE_1, model=Potential(order), initial=(0.15, 0.0),
        supports=[Roller("inner", "r")], baths=[Bath("outer", c=DILUTED)],
    )  # fmt: skip
    state = scene.run(100.0, Fixed(25.0), newton=DampedNewton(tolerance=1e-11)).state
    return np.array([[state.at((r,), name) for r in np.arange(3, 10) / 10] for name in ("displacement", "fluid_potential")])


@pytest.mark.parametrize("kinematics", [Cylindrical(), Spherical()], ids=str)
def test_order_in_space(kinematics):
    """Differences of meshes halved; u of order 2, P and c̃ of order 1: values at vertices converge with h²."""
    coarse, middle, fine = (swollen(kinematics, cells) for cells in (8, 16, 32))
    orders = np.log2(np.abs(coarse - middle).max(axis=1) / np.abs(middle - fine).max(axis=1))
    assert orders == pytest.approx([2.0, 2.0], abs=0.2)


# -- reactions, supports, refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kinematics", [Cylindrical(), Spherical()], ids=str)
def test_reaction_and_stress_of_a_thick_shell_that_cannot_swell(kinematics):
    """Held inside and out and uniform, nothing moves: the radial stress is −p0, and the walls bear it on their area."""
    scene = body(kinematics, 0.5, material=TABLE_1, baths=[Bath("outer", c=0.15)], supports=[Roller("inner|outer", "r")])
    inside, outside = Reaction("inner"), Reaction("outer")
    result = scene.run(10.0, Fixed(10.0), [inside, outside, Stability()])
    stress = result.state.at((0.7,), "stress")[0]
    area = [(kinematics.power == 3 and 4 * pi * r * r) or 2 * pi * r for r in (0.5, 1.0)]
    assert stress < -0.1
    # The wall pushes the body back: N per mm of a cylinder's length, N on a whole sphere.
    assert [inside.values[-1, 0], outside.values[-1, 0]] == pytest.approx([stress * area[0], -stress * area[1]], rel=1e-9)
    assert inside.unit("force") == ("N" if kinematics.power == 3 else "N/mm")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: body(Spherical(), supports=[]), r"Spherical: the mesh touches the centre r = 0; hold it there"),
        (lambda: body(Cylindrical(), supports=[]), "Cylindrical: the mesh touches"),
        (lambda: body(Spherical(), baths=[Bath("inner", c=0.1)], supports=[Roller("inner", "r")]), "has no area"),
        (lambda: body(Cylindrical(), supports=[Roller("inner", "x")]), "none of r"),
        (lambda: Scene(mesh=rectangle(1, 1, 1, 1), kinematics=Spherical(), material=TABLE_1), "Spherical needs a 1-d mesh"),
        (lambda: ray(1.0, 1.0, 3), "outer = 1 mm has to be larger than inner = 1 mm"),
        (lambda: ray(-1.0, 1.0, 3), "ray: inner = -1 mm"),
        (lambda: ray(0.0, 1.0, 3, grade={"top": 3}), "'top' is none of 'inner', 'outer'"),
        (lambda: ray(0.5, 1.0, 3, lines={"r": 0.4}), "different places between 0.5 and 1"),
        (lambda: ray(0.5, 1.0, 3, lines={"x": 0.7}), "'x' is none of 'r'"),
    ],
)  # fmt: skip
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_a_ray_has_its_regions_lines_and_grade():
    mesh = ray(0.5, 1.0, 4, grade={"outer": 8}, lines={"r": 0.9}, regions={"r": ["core", "shell"]})
    nodes = np.sort([vertex.point[0] for vertex in mesh.vertices])
    assert nodes[[0, -1]] == pytest.approx([0.5, 1.0])
    assert 0.9 in nodes
    assert np.diff(nodes)[0] > 2 * np.diff(nodes)[-1]
    assert mesh.GetMaterials() == ("core", "shell")
    assert set(mesh.GetBoundaries()) == {"inner", "outer"}


def test_a_column_has_symmetry_planes_too():
    scene = Scene(
        mesh=column(0.5, 2), kinematics=Confined(), material=TABLE_1, supports=[Symmetry("bottom")],
        baths=[Bath("top", c=0.15)],
    )  # fmt: skip
    assert scene.fixed() == {"x": "bottom"}
