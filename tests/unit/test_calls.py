"""Plausible mistakes in calls are refused by name, never with a bare error of Python or of a binding."""

import inspect
from dataclasses import replace
from enum import Enum

import pytest

import ngswell
from ngswell import (
    TABLE_1,
    VTK,
    Adaptive,
    Bath,
    Blend,
    Call,
    Checkpoint,
    Fixed,
    InputError,
    Ledger,
    Material,
    Nitsche,
    Penalty,
    Pin,
    PlaneStrain,
    Probe,
    Ramp,
    Roller,
    Scene,
    Snapshots,
    Symmetry,
    Traction,
    Weight,
    column,
    from_occ,
    read_mesh,
    rectangle,
)
from ngswell.calls import refusing
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium

MESH = rectangle(1.0, 1.0, 1, 1)
GIVEN = {
    "mesh": MESH,
    "kinematics": PlaneStrain(),
    "material": TABLE_1,
    "supports": [Roller("bottom", "xy")],
    "baths": [Bath("top", c=0.15)],
}


def scene(**changes):
    return Scene(**GIVEN | changes)


MISTAKES = {
    "a displacement where symmetries have none": (lambda: Symmetry("top", -0.1), "Symmetry: .* it takes boundary"),
    "a misspelt parameter": (lambda: Material(mu=1, lamda=1), "no argument 'lamda'; 'lam' may be meant"),
    "the same in a copy": (lambda: replace(TABLE_1, lamda=2), "no argument 'lamda'; 'lam' may be meant"),
    "parameters without names": (lambda: Material(0.2, 0.1), "by name: mu, lam"),
    "pieces without names": (lambda: Scene(MESH, PlaneStrain(), TABLE_1), "by name: mesh, kinematics"),
    "one bath": (lambda: scene(bath=[]), "no argument 'bath'; 'baths' may be meant"),
    "a shape as kinematics": (lambda: scene(kinematics=MESH), "kinematics has to be"),
    "a class as kinematics": (lambda: scene(kinematics=PlaneStrain), "the class PlaneStrain"),
    "a file as mesh": (lambda: scene(mesh="a.msh"), "mesh has to be"),
    "a table as material": (lambda: scene(material={"mu": 1}), "material has to be"),
    "a number as charge": (lambda: scene(charge=1.0), "charge has to be"),
    "a bath without its boundary": (lambda: Bath(), "missing a required argument: 'boundary'"),
    "too much of a bath": (lambda: Bath("top", 0.15, 0.0, Penalty(1), True, None, 4), "Bath: too many"),
    "boundaries in a list": (lambda: Roller(["top"], "y"), "boundary has to be a name"),
    "no cells": (lambda: rectangle(1, 1), "missing a required argument: 'nx'"),
    "a misspelt grade": (lambda: rectangle(1, 1, 2, 2, grading={}), "'grade' may be meant"),
    "no cells in a column": (lambda: column(1), "missing a required argument: 'cells'"),
    "no direction": (lambda: Pin((0, 0)), "'direction'"),
    "components one by one": (lambda: Traction("top", 0.1, 0.2), "Traction: too many"),
    "no weights": (lambda: Weight(), "'fluid'"),
    "a ramp of numbers": (lambda: Ramp(0, 1), "point has to be"),
    "half a blend": (lambda: Blend(1, 2), "'weight'"),
    "a fixed step without its size": (lambda: Fixed(), "'step'"),
    "too much of Nitsche": (lambda: Nitsche(10, "symmetric", 3), "Nitsche: too many"),
    "a word as tolerance": (lambda: Adaptive("fine"), "tolerance"),
    "a picture without its file": (lambda: VTK(), "'path'"),
    "a checkpoint without its file": (lambda: Checkpoint(), "'path'"),
    "no times": (lambda: Snapshots(), "'when'"),
    "a number as function": (lambda: Call(3), "Call has to be given a function"),
    "a probe without a quantity": (lambda: Probe((0, 0)), "name at least one quantity"),
    "a shape without its size": (lambda: from_occ(3), "'maxh'"),
    "a number as file": (lambda: read_mesh(3), "path has to be"),
    "no end": (lambda: scene().run(), "Scene.run: missing a required argument: 'until'"),
    "one step": (lambda: scene().run(1, step=2), "'steps' may be meant"),
    "a class as observer": (lambda: scene().run(1, observers=[Ledger]), "the class Ledger"),
    "the name of a solver": (lambda: scene().run(1, solver="umfpack"), "solver has to"),
    "a number as Newton's method": (lambda: scene().run(1, newton=1e-8), "newton has to be"),
    "a number to go on from": (lambda: scene().run(1, resume=1), "resume has to be"),
    "a number as state": (lambda: scene().state(3), "state has to be"),
    "no step": (lambda: scene().growth_factor(), "'dt'"),
    "an equilibrium of nothing": (lambda: homogeneous_equilibrium(TABLE_1), "'salt'"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_refused(mistake):
    call, words = MISTAKES[mistake]
    with pytest.raises(InputError, match=words):
        call()


def test_a_state_is_asked_at_a_point():
    state = scene().state(scene().problem.snapshot(0.0))
    for wrong, words in (((0.5, "J"), "a point has to be"), (((0.5, 0.5),), "'name'"), (((2.0, 2.0), "J"), "not a point")):
        with pytest.raises(InputError, match=words):
            state.at(*wrong)


def test_every_public_call_is_covered():
    things = [getattr(ngswell, name) for name in ngswell.__all__]
    classes = [thing for thing in things if inspect.isclass(thing) and not issubclass(thing, (Exception, Enum))]
    functions = [thing for thing in things if inspect.isfunction(thing)]
    assert len(classes) > 40
    assert len(functions) > 4
    own = [vars(thing)["__init__"] for thing in classes if inspect.isfunction(vars(thing).get("__init__"))]
    assert all(hasattr(function, "__wrapped__") for function in own + functions)


def test_errors_within_a_call_stay_what_they_are():
    @refusing
    def adds(a, b=1):
        return a + b

    assert adds(1) == 2
    with pytest.raises(TypeError, match="concatenate"):
        adds("a")
    with pytest.raises(InputError, match="it takes a, b"):
        adds()
