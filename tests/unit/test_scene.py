"""What a scene refuses before any computing, by name, value and remedy."""

import math

import pytest
from ngsolve import x

from ngswell import (
    TABLE_1,
    Bath,
    Blend,
    Confined,
    Essential,
    Frozen,
    InputError,
    Lagged,
    LocalDonnan,
    Multiplier,
    Nitsche,
    Penalty,
    Pin,
    PlaneStrain,
    Potential,
    Ramp,
    Roller,
    Scene,
    Symmetry,
    Traction,
    Uncharged,
    Weight,
    column,
)
from tests.scenes import WITHOUT_IONS, strip


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"baths": [Bath("topp", c=0.15)]}, "'topp'.*bottom, left, right, top"),
        ({"baths": [Bath("top", c=0.15), Bath("left|top", c=0.15)]}, "'top' already has a bath"),
        ({"supports": [Roller("botom", "y")]}, "'botom'"),
        ({"supports": [Roller("bottom", "z")]}, "'z'"),
        ({"supports": [Roller("bottom", "y")]}, "translate in x"),
        ({"supports": [Roller("left", "x")]}, "translate in y"),
        ({"supports": [Pin((0.0, 0.0), "xy")]}, "rotate"),
        ({"supports": [Roller("left|right", "x"), Pin((0.001, 0.0), "y")]}, "nearest"),
        ({"supports": [Roller("left|right", "x"), Pin((0.0,), "y")]}, "2 coordinates"),
        ({"supports": [Symmetry("top"), Roller("left", "x")]}, "Symmetry on 'top'.*bath"),
        ({"loads": [Traction("tip", (0.0, -0.1))]}, "'tip'"),
        ({"loads": [Traction("bottom", (0.0, -0.1))]}, "no effect"),
        ({"loads": [Traction("top", (0.0,))]}, "2 components"),
        ({"loads": [Weight((0.0, 0.0), (0.0, 0.0)), Weight((0.0, 0.0), (0.0, 0.0))]}, "more than one Weight"),
        ({"kinematics": Confined()}, "1-d mesh"),
        ({"baths": []}, "initial="),
        ({"baths": [Bath("top", c=0.15), Bath("bottom", c=0.2)]}, "differ at the start"),
        ({"charge": Ramp((0, -1.0))}, "charge factor"),
        ({"baths": [Bath("top", P=0.1)]}, "Concentration needs its salt concentration"),
        ({"baths": [Bath("top", c=0.15, treatment=Essential())]}, "it has Penalty, Nitsche, Multiplier, Lagged, Frozen"),
        ({"initial": (None, 0.0)}, "needs a salt concentration"),
        (
            {"baths": [Bath("top", c=0.15, treatment=Multiplier()), Bath("left", c=0.15, treatment=Lagged())]},
            r"'top' and 'left' touch: Multiplier\(\).*Lagged.*take Penalty, Nitsche or Multiplier",
        ),
        (
            {"baths": [Bath("left", c=0.15, treatment=Frozen()), Bath("top", c=0.15, treatment=Multiplier())]},
            r"'top' and 'left' touch: Multiplier\(\).*Frozen\(\)",
        ),
        (
            {"model": Potential(), "baths": [Bath("top", c=0.15, treatment=Nitsche())]},
            r"'top': Potential has no Nitsche\(.*it has Essential, Penalty",
        ),
        (
            {"model": Potential(), "baths": [Bath("top", c=0.15, treatment=Multiplier())]},
            r"Potential has no Multiplier\(\); it has Essential, Penalty",
        ),
        (
            {"model": Potential(), "baths": [Bath("top", c=0.15, treatment=Lagged())]},
            r"Potential has no Lagged.*; it has Essential, Penalty",
        ),
        (
            {
                "model": Potential(),
                "baths": [Bath("top", c=0.1, treatment=Essential()), Bath("top", c=0.1, treatment=Penalty(1.0))],
            },
            "'top' already has a bath",
        ),
        ({"model": Potential(), "baths": [Bath("top", P=0.1)]}, "'top': Potential needs its salt concentration"),
        ({"model": Potential(), "initial": (None, 0.0)}, "initial: Potential needs a salt concentration"),
        (
            {
                "model": Uncharged(),
                "material": WITHOUT_IONS,
                "baths": [Bath("top", treatment=Nitsche())],
                "initial": (None, 0.0),
            },
            r"Uncharged has no Nitsche\(.*it has Essential, Penalty",
        ),
        ({"model": Uncharged()}, "cfc0"),
        ({"model": Uncharged(), "material": WITHOUT_IONS}, "takes no concentration"),
        ({"model": LocalDonnan(), "baths": []}, "needs a bath"),
        ({"mesh": "top"}, "mesh has to be a mesh of NGSolve.*'top'"),
        ({"kinematics": PlaneStrain}, "kinematics has to be .*got the class PlaneStrain"),
        ({"model": Potential}, r"model has to be Potential\(\).*got the class Potential"),
        ({"material": None}, "material has to be a Material.*None"),
        ({"baths": Bath("top", c=0.1)}, r"baths has to be a list, got one Bath: put it in brackets, \["),
        ({"baths": [Roller("top", "x")]}, "entry of baths has to be Bath.*Roller"),
        ({"supports": None}, "supports has to be a list.*None"),
        ({"supports": [Bath("top", c=0.1)]}, "entry of supports has to be Roller.*Bath"),
        ({"charge": 0.5}, "charge has to be a Ramp"),
        ({"start": math.nan}, "start = nan"),
        ({"initial": (0.1,)}, r"initial has to be \(concentration.*\(0.1,\)"),
        ({"initial": (0.1, 0.0, Penalty(1.0))}, "initial has to be"),
        ({"baths": [Bath("top", c=Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), 200 * x))]}, "Blend: weight = "),
        ({"baths": [Bath("top", c=Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), x + math.nan))]}, "Blend: weight = nan"),
        ({"model": LocalDonnan(), "baths": [Bath("top", c=0.1), Bath("bottom", c=0.2)]}, "differ in concentration"),
        ({"model": LocalDonnan(), "baths": [Bath("top", c=0.1, treatment=Lagged())]}, "it has Essential, Penalty"),
    ],
)
def test_refused(change, words):
    with pytest.raises(InputError, match=words):
        strip(**change)


def test_kinematics_are_interchangeable_only_where_they_fit():
    with pytest.raises(InputError, match="PlaneStrain needs a 2-d mesh"):
        Scene(mesh=column(1.0, 2), kinematics=PlaneStrain(), material=TABLE_1, baths=[Bath("top", c=0.1)])


def test_zero_current_is_named_where_it_is_more_than_conservation_of_charge():
    """In 2-d and 3-d between baths that differ; in 1-d both agree, and without ions there is no current."""
    constant, changing = Ramp((0, 0.15)), Ramp((0, 0.15), (10, 0.1))
    blended = Blend(constant, changing, 50 * x)
    uncharged = {"model": Uncharged(), "material": WITHOUT_IONS, "loads": []}

    def named(**changes):
        return "zero current" in strip(None, **{"model": Potential(), "cells": (1, 2), **changes}).describe()

    assert "made of derivatives" in strip(None, cells=(1, 2)).describe()
    assert named(baths=[Bath("top", c=changing), Bath("bottom", c=0.15)])
    assert named(baths=[Bath("top", c=blended)])
    assert named(baths=[Bath("top", c=blended), Bath("bottom", c=Blend(constant, changing, 0.5 + 25 * x))])
    assert not named()
    assert not named(baths=[Bath("top", c=changing), Bath("bottom", c=changing)])
    assert not named(baths=[Bath("top"), Bath("bottom", P=Ramp((0, 0.0), (1, 0.1)))], **uncharged)
    sides = [Bath("top", c=changing), Bath("bottom", c=0.15)]
    assert not named(mesh=column(0.5, 2), kinematics=Confined(), supports=[Roller("bottom", "x")], baths=sides, loads=[])
