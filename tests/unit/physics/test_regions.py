"""Parameters and materials by region: rest against closed forms in each layer, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from netgen.occ import Glue, MoveTo, Rectangle, Y
from ngsolve import IfPos, x

from ngswell import (
    TABLE_1,
    TABLE_2,
    Bath,
    Concentration,
    Confined,
    Efflux,
    Fixed,
    InputError,
    Integral,
    LocalDonnan,
    MackieMeares,
    Material,
    Multiplier,
    Nitsche,
    Obstacle,
    Penalty,
    PlaneStrain,
    Potential,
    PowerLaw,
    Pressure,
    Ramp,
    RigidPlane,
    Roller,
    Scene,
    by_region,
    column,
    from_occ,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium

SKIN = replace(TABLE_1, mu=0.5, lam=0.1, nS0=0.3, cfc0=0.4, K=2e-4, D_plus=1e-4, D_minus=3e-4)
LAYERS = {"lines": {"x": 0.3}, "regions": {"x": ["core", "skin"]}}


def bilayer(material=None, cells=4, **changes):
    """A column of 0.3 mm of core under 0.2 mm of skin."""
    mesh = column(0.5, cells, **LAYERS)
    material = material or by_region(mesh, core=TABLE_1, skin=SKIN)
    treatment = changes.pop("treatment", None)
    parts = {
        "kinematics": Confined(),
        "supports": [Roller("bottom", "x")],
        "baths": [Bath("top", c=0.15, treatment=treatment)],
    }
    return Scene(mesh=mesh, material=material, **{**parts, **changes})


def at_rest(core, skin):
    """J of each layer, from its own homogeneous state: the total stress is P̄ = 0 in both, and the bath is the same."""
    return [homogeneous_equilibrium(material, 0.15, "confined").J for material in (core, skin)]


def found(scene):
    state = scene.state(scene.equilibrate())
    return [float(state.at((place,), "J")) for place in (0.1, 0.29, 0.31, 0.45)]


@pytest.mark.parametrize(
    ("model", "treatment"),
    [(Potential(), None), (Potential(order=3), None), (Potential(), Penalty(relative=1e4)), (LocalDonnan(), None)],
    ids=str,
)
def test_each_layer_rests_at_its_own_state(model, treatment):
    core, skin = at_rest(TABLE_1, SKIN)
    # The displacement is linear in each layer and lies in the space: what is left is round-off.
    assert found(bilayer(model=model, treatment=treatment)) == pytest.approx([core, core, skin, skin], rel=1e-9)
    assert abs(skin / core - 1) > 0.03  # swapped or averaged layers would show


@pytest.mark.parametrize("treatment", [None, Penalty(40.0), Nitsche(), Nitsche(0.0, "skew"), Multiplier()], ids=str)
def test_treatments_of_the_paper_s_model_with_layers(treatment):
    """K, D and µ by layers. J, and with it the charge, jumps with µ, which a continuous charge field smears over a cell:
    off by 2e-4 for twice µ; K and D leave nothing."""
    material = replace(SKIN, cfc0=TABLE_1.cfc0, nS0=TABLE_1.nS0, mu=TABLE_1.mu, lam=TABLE_1.lam)
    mesh = column(0.5, 4, **LAYERS)
    (core, _) = at_rest(TABLE_1, TABLE_1)
    same = by_region(mesh, core=TABLE_1, skin=material)
    parts = {"model": Concentration(), "treatment": treatment}
    assert found(bilayer(same, **parts)) == pytest.approx([core] * 4, rel=1e-9)
    stiff = replace(material, mu=0.5)
    core, skin = at_rest(TABLE_1, stiff)
    assert found(bilayer(by_region(mesh, core=TABLE_1, skin=stiff), **parts))[::3] == pytest.approx([core, skin], abs=2e-4)


def test_numbers_by_region_are_those_of_materials_by_region():
    mesh = rectangle(0.2, 0.5, 2, 4, lines={"y": 0.3}, regions={"y": ["core", "skin"]})
    of_numbers = Material(
        **{
            name: by_region(mesh, core=TABLE_1.number(name), skin=SKIN.number(name))
            for name in ("mu", "lam", "nS0", "cfc0", "D_plus", "D_minus", "K")
        }
    )
    ends = []
    for material in (of_numbers, by_region(mesh, core=TABLE_1, skin=SKIN)):
        supports = [Roller("bottom", "y"), Roller("left|right", "x")]
        scene = Scene(
            mesh=mesh, kinematics=PlaneStrain(), material=material, supports=supports,
            baths=[Bath("top", c=Ramp((0, 0.15), (10, 0.1)))],
        )  # fmt: skip
        ends.append(scene.run(20.0, Fixed(5.0), resume=scene.equilibrate()).end.values)
    assert np.array_equal(*ends)


def test_what_agrees_stays_one_number():
    mesh = column(0.5, 4, **LAYERS)
    material = by_region(mesh, core=TABLE_1, skin=replace(TABLE_1, mu=1.2))
    assert material == replace(TABLE_1, mu=material.mu)
    where = mesh(np.array([0.1, 0.4]))
    assert material.mu(where).ravel() == pytest.approx([0.24, 1.2])
    assert by_region(column(0.5, 4), dom=TABLE_2) == TABLE_2


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"core": 1.0, "skn": 2.0}, "no region 'skn'; it has 'core', 'skin'; 'skin' may be meant"),
        ({"core": 1.0}, "'skin' has no value; give one for every region: 'core', 'skin'"),
        ({}, "'core', 'skin' has no value"),
        ({"core": 1.0, "skin": "soft"}, "skin has to be a number, got 'soft'"),
        ({"core": 1.0, "skin": float("nan")}, "skin = nan is not finite"),
        ({"core": 1.0, "skin": True}, "skin has to be a number, got True"),
        ({"core": 1.0, "skin": TABLE_1}, "skin has to be a number, got Material"),
        ({"core": TABLE_1, "skin": replace(TABLE_1, theta=310.0)}, "theta is 298.0 in 'core' but 310.0 in 'skin'"),
        ({"core": TABLE_1, "skin": replace(TABLE_1, Gamma=0.9)}, "Gamma .* same in every region"),
        ({"core": TABLE_1, "skin": replace(TABLE_1, permeability=PowerLaw(2.0))}, "permeability .* PowerLaw"),
        ({"core": TABLE_1, "skin": Material(mu=1.0, lam=0.0, nS0=0.2, K=1e-3)}, "D_plus is missing in 'skin'"),
        ({"core": TABLE_1, "skin": replace(TABLE_1, diffusivity=MackieMeares())}, "diffusivity"),
    ],
)
def test_refused(values, words):
    with pytest.raises(InputError, match=words):
        by_region(column(0.5, 4, **LAYERS), **values)


def test_calls_without_a_mesh_and_values_out_of_range():
    with pytest.raises(InputError, match=r"missing .* 'mesh'"):
        by_region(core=1.0)
    with pytest.raises(InputError, match="mesh has to be a mesh"):
        by_region("mesh", core=1.0)
    with pytest.raises(InputError, match=r"nS0 = 1.5 .* outside"):
        bilayer(replace(TABLE_1, nS0=by_region(column(0.5, 4, **LAYERS), core=0.2, skin=1.5)))


def test_a_field_of_another_mesh_is_refused():
    other = column(0.5, 4, lines={"x": 0.3}, regions={"x": ["skin", "core"]})
    with pytest.raises(InputError, match="mu is by_region of another mesh, with the regions 'skin', 'core'"):
        bilayer(replace(TABLE_1, mu=by_region(other, core=0.2, skin=0.4)))


@pytest.mark.parametrize("charge", ["by region", "by place"])
def test_a_charge_that_jumps_needs_a_model_that_can(charge):
    mesh = column(0.5, 4, **LAYERS)
    field = by_region(mesh, core=0.2, skin=0.4) if charge == "by region" else IfPos(x - 0.3, 0.4, 0.2)
    with pytest.raises(InputError, match=r"cfc0 jumps .* Potential"):
        bilayer(replace(TABLE_1, cfc0=field), model=Concentration())
    bilayer(replace(TABLE_1, cfc0=field))
    bilayer(replace(TABLE_1, cfc0=0.2 + 0.8 * x * x), model=Concentration())  # smooth, though it doubles


def test_what_acts_from_outside_needs_the_surface():
    """A bath, a flow, a pressure or an obstacle has no side on the interface of two regions; it may be observed and held."""
    core, skin = Rectangle(1, 0.5).Face(), MoveTo(0, 0.5).Rectangle(1, 0.5).Face()
    core.edges.Min(Y).name, core.edges.Max(Y).name, skin.edges.Max(Y).name = "bottom", "interface", "top"
    mesh = from_occ(Glue([core, skin]), 0.5)

    def scene(bath="top", supports=(), loads=()):
        return Scene(
            mesh=mesh, kinematics=PlaneStrain(), material=TABLE_1, model=LocalDonnan(), baths=[Bath(bath, c=0.15)],
            supports=[Roller("bottom", "xy"), *supports], loads=loads,
        )  # fmt: skip

    for make in (
        lambda: scene("interface"),
        lambda: scene(loads=[Pressure("interface", 0.1)]),
        lambda: scene(loads=[Efflux("interface", 1e-6)]),
        lambda: scene(loads=[Obstacle("interface", RigidPlane((0.0, 2.0), (0.0, -1.0)))]),
    ):
        with pytest.raises(InputError, match="boundary 'interface' is inside the body near"):
            make()
    observed = Integral("J", "interface")
    scene(supports=[Roller("interface", "x")]).equilibrate(observers=[observed])
    assert observed.values[-1] > 1
