"""Supports that move: what is refused, and what comes out."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import x

from ngswell import (
    TABLE_1,
    TABLE_2,
    Adaptive,
    Axisymmetric,
    Bath,
    Blend,
    Checkpoint,
    Concentration,
    Confined,
    DampedNewton,
    Fixed,
    InputError,
    Ledger,
    LocalDonnan,
    Penalty,
    Pin,
    PlaneStrain,
    Potential,
    Ramp,
    Reaction,
    Roller,
    Scene,
    Sine,
    Spline,
    Stability,
    Symmetry,
    Traction,
    column,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import BETWEEN_WALLS

DOWN = Ramp((0, 0.0), (100, -0.1))


def column_between(*supports, **changes):
    """A column of 0.5 mm at rest in 0.3 mol/l without charge, which `supports` hold at its ends."""
    return Scene(
        **{
            "mesh": column(0.5, 4), "kinematics": Confined(), "material": TABLE_1, "model": Potential(),
            "supports": supports or [Roller("bottom", "x"), Roller("top", "x", DOWN)],
            "baths": [Bath("top", c=0.3)], "charge": Ramp((0, 0.0), (1e4, 1.0)), **changes,
        }
    )  # fmt: skip


def block(*supports, **changes):
    return Scene(
        **{
            "mesh": rectangle(1.0, 1.0, 2, 2), "kinematics": PlaneStrain(), "material": TABLE_2, "model": LocalDonnan(),
            "supports": supports, "baths": [Bath("right", c=0.3)], **changes,
        }
    )  # fmt: skip


def hold(*moving):
    return block(Symmetry("bottom"), Symmetry("left"), *moving)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Roller("top", "xy", DOWN), "has to be 2 numbers or histories, one a direction"),
        (lambda: Roller("top", "xy", -0.1), "has to be 2 numbers or histories"),
        (lambda: Roller("top", "y", (DOWN, DOWN)), "has to be 1 numbers or histories"),
        (lambda: Roller("top", "y", "down"), r"displacement \[mm\] has to be a number"),
        (lambda: Roller("top", "y", float("nan")), "not finite"),
        (lambda: Roller("top", "y", Blend(Ramp((0, 0.0)), DOWN, x)), "varies in space"),
        (lambda: hold(Roller("top", "yy", (DOWN, DOWN))), "names one twice"),
        (lambda: hold(Roller("top", "y", Ramp((0, 0.0), (1, -100.0)))), "goes to -100 mm, more than 10 lengths.*in mm"),
        (lambda: hold(Roller("top", "y", -0.1)), r"-0.1 mm at the start \(0 s\).*Ramp\(\(0, 0.0\), \(1, -0.1\)\).*after"),
        (lambda: hold(Roller("left", "x", DOWN)), "Symmetry on 'left' and Roller on 'left' hold .* in x .* differently"),
        (lambda: hold(Roller("top", "x", DOWN)), r"hold the displacement in x at the vertex \(0, 1\) mm differently"),
        (lambda: block(Roller("bottom", "xy"), Roller("right", "y", DOWN)), r"vertex \(1, 0\) mm differently"),
        (lambda: hold(Roller("top", "y", DOWN), Roller("right", "y", Ramp((0, 0.0), (99, -0.1)))), "differently"),
        (lambda: block(Symmetry("left"), Roller("top", "y", DOWN), Pin((1.0, 1.0), "y")), "which a Pin holds: leave"),
        (
            lambda: block(Roller("left", "r", DOWN), Symmetry("bottom"), kinematics=Axisymmetric()),
            "touches the axis r = 0; hold it there",
        ),
        (lambda: hold(Roller("top", "y", DOWN), Traction("top", (0.0, -0.1))), "supports has to be"),
        (
            lambda: block(Symmetry("left"), Roller("top", "y", DOWN), loads=[Traction("top", (0.0, -0.1))]),
            "a support holds it in y, so it has no effect",
        ),
    ],
)  # fmt: skip
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_what_agrees_is_taken():
    block(Symmetry("left"), Roller("top", "y", DOWN), Roller("top", "y", Ramp((0, 0.0), (100, -0.1))))
    block(Roller("bottom", "xy"), Roller("top", "xy", (0.0, DOWN)), Roller("left", "x", Ramp((5, 0.0), (6, 0.0))))
    block(Symmetry("left"), Roller("top|bottom", "y", DOWN))  # carried along as a whole


# -- where it is, in every motion ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", BETWEEN_WALLS)
def test_a_held_height_bears_the_load_that_gives_it(motion):
    """Between walls, in equilibrium with 0.3 mol/l: the swelling pressure at J is the load under which J is at rest."""
    mesh, kinematics, walls, up, area = BETWEEN_WALLS[motion]
    load = 0.05
    rest = homogeneous_equilibrium(TABLE_2, 0.3, "confined", load=load)
    scene = Scene(
        mesh=mesh(), kinematics=kinematics, material=TABLE_2, model=LocalDonnan(), baths=[Bath("top", c=0.3)],
        supports=[Roller("bottom", up), Roller("top", up, Ramp((0, 0.0), (100, rest.J - 1))), *walls],
    )  # fmt: skip
    top = Reaction("top")
    scene.equilibrate(100.0, observers=[top], unstable="off")
    assert top.values[-1, -1] == pytest.approx(load * area, rel=1e-9)  # what Newton's method leaves


def test_a_large_displacement_at_once():
    """A third of the height in one solve: the prescribed values are part of the damped correction."""
    scene = block(
        Roller("bottom", "xy"), Roller("top", "xy", (0.0, Ramp((0, 0.0), (1, -1 / 3)))), material=TABLE_1,
        mesh=rectangle(1.0, 1.0, 4, 4),
    )  # fmt: skip
    base, top = Reaction("bottom"), Reaction("top")
    state = scene.state(scene.equilibrate(1.0, observers=[base, top], unstable="off"))
    assert state.at((0.37, 1.0), "displacement") == pytest.approx((0.0, -1 / 3), abs=1e-15)
    assert top.values[-1] == pytest.approx(-base.values[-1], abs=1e-10)  # in balance


@pytest.mark.parametrize("model", [Potential(), Concentration(), LocalDonnan()])
@pytest.mark.parametrize("steps", [Fixed(250.0), Adaptive(1e-4)])
def test_runs_follow_the_history_in_balance(model, steps):
    """Glued ends, pushed and pulled while the charge rises: displacement of the history, forces and fluid in balance."""
    baths = [Bath("right", c=0.3, treatment=Penalty(relative=100.0) if isinstance(model, Concentration) else None)]
    way = Ramp((0, 0.0), (500, -0.2), (1000, 0.1))
    scene = hold(Roller("top", "xy", (0.0, way)))
    scene = replace(scene, model=model, baths=baths, charge=Ramp((0, 0.0), (1000, 0.2)))
    top, base, ledger = Reaction("top"), Reaction("bottom"), Ledger()
    newton = DampedNewton()
    result = scene.run(1500.0, steps, [top, base, ledger], newton=newton, unstable="off")
    assert scene.state(result.end).at((0.7, 1.0), "displacement") == (0.0, 0.1)
    assert {500.0, 1000.0} <= set(top.time)  # steps end at its kinks
    assert top.values[:, 1] == pytest.approx(-base.values[:, 1], abs=1e-9)
    # the fluid that left is what the volume lost: ∫J at the end
    assert ledger.imbalance()["fluid"] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(top.values[:, 0]).max() > 1e-3  # it is glued: it bears along x as well


HISTORIES = [Sine(0.0, 0.02, 40.0, 2), Spline((0, 0.0), (50, -0.05), (100, -0.02)), Ramp((0, 0.0), (9, -0.02))]


@pytest.mark.parametrize("history", HISTORIES)
def test_histories(history):
    scene = column_between(Roller("bottom", "x"), Roller("top", "x", history))
    found = []
    scene.run(100.0, Adaptive(1e-3), [lambda time, state: found.append((time, state.at((0.5,), "displacement")))])
    for time, displacement in found:
        assert displacement == pytest.approx(history.at(time), abs=1e-15)
    assert {*history.kinks, *history.bends} <= {time for time, _ in found} | {t for t in history.bends if t > 100}


# -- parts of a test -----------------------------------------------------------------------------------------------------


def test_two_parts_are_one_run(tmp_path):
    way = Ramp((0, 0.0), (100, -0.1), (200, -0.02))
    scene = column_between(Roller("bottom", "x"), Roller("top", "x", way))
    through = scene.run(200.0, Fixed(20.0)).end.values
    first = scene.run(100.0, Fixed(20.0))
    resumed = scene.run(200.0, Fixed(20.0), resume=first.end)
    assert np.abs(resumed.end.values - through).max() < 1e-13  # the matrix that goes on differs
    later = [Roller("bottom", "x"), Roller("top", "x", Ramp((0, -0.1), (100, -0.02)))]
    charge = Ramp((0, 0.01), (9900, 1.0))
    second = scene.after(first, start=0.0, supports=later, charge=charge).run(100.0, Fixed(20.0))
    assert np.abs(second.end.values - through).max() < 1e-13
    kept = Checkpoint(tmp_path / "run")
    scene.run(60.0, Fixed(20.0), checkpoint=kept)
    assert np.array_equal(scene.run(200.0, Fixed(20.0), checkpoint=kept).end.values, through)
    with pytest.raises(InputError, match="supports"):
        column_between().run(200.0, Fixed(20.0), checkpoint=kept)


def test_a_support_takes_over_where_the_body_is():
    """Creep under a load, then relaxation at the height reached: the force starts at the load and falls."""
    scene = column_between(Roller("bottom", "x"), loads=[Traction("top", (Ramp((0, 0.0), (10, -0.3)),))])
    crept = scene.run(30.0, Fixed(1.0))
    height = scene.state(crept.end).at((0.5,), "displacement")
    held, force = [Roller("bottom", "x"), Roller("top", "x", height)], Reaction("top")
    part = scene.after(crept, supports=held, loads=[])
    end = part.run(300.0, Fixed(10.0), [force]).end
    assert part.state(end).at((0.5,), "displacement") == height
    assert force.values[0, 0] == pytest.approx(0.3, abs=1e-9)
    assert 0.0 < force.values[-1, 0] < 0.25
    for wrong, said in (
        ({"supports": [Roller("bottom", "x"), Roller("top", "x")]}, r"mm near \(0.5\) mm, where .* holds it at 0 mm"),
        ({"supports": [Roller("bottom", "x"), Roller("top", "x", 2 * height)]}, "give the Roller that displacement"),
    ):
        with pytest.raises(InputError, match=said):
            scene.after(crept, loads=[], **wrong)
    moving = column_between()
    end = moving.run(50.0, Fixed(10.0)).end
    with pytest.raises(InputError, match="supports keep a history of the clock"):
        moving.after(end, start=0.0, charge=Ramp((0, 0.005)))
    # values of a moving support that were shifted by hand
    values = end.values.copy()
    values[4] += 1e-3
    with pytest.raises(InputError, match=r"displaces the body by -0.049 mm near \(0.5\) mm, where .* holds it at -0.05 mm"):
        moving.run(60.0, resume=replace(end, values=values))


def test_perturbations_vanish_there():
    """A squeezed block between two glued supports: no mode moves its ends."""
    scene = hold(Roller("top", "xy", (0.0, Ramp((0, 0.0), (10, -0.1)))))
    watch = Stability(over=1e6)
    rest = scene.equilibrate(10.0, observers=[watch])
    assert list(watch.rates) == [0.0]
    growth = scene.growth_factor(10.0, replace(rest, time=10.0))
    assert 0 < growth.factor < 1
    mode = growth.mode.components[0]
    moved = max(np.linalg.norm(mode(scene.mesh(s, 1.0))) for s in (0.2, 0.5, 0.9))
    assert moved == 0.0 < np.linalg.norm(mode(scene.mesh(1.0, 0.5)))
