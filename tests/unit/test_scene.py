"""Bad input is refused before any computing, by name, value and remedy."""

import math
from dataclasses import replace

import numpy as np
import pytest
from ngsolve import CF, x

from ngswell import (
    TABLE_1,
    VTK,
    Adaptive,
    Area,
    Bath,
    Blend,
    Concentration,
    Confined,
    Essential,
    Fixed,
    Frozen,
    InputError,
    Integral,
    Lagged,
    Ledger,
    LocalDonnan,
    Material,
    Multiplier,
    Newton,
    NgswellError,
    Nitsche,
    OutputError,
    Penalty,
    Pin,
    PlaneStrain,
    Potential,
    Probe,
    Ramp,
    Roller,
    Scene,
    Snapshots,
    Symmetry,
    Traction,
    Uncharged,
    Weight,
    column,
    rectangle,
)
from ngswell.analysis.stability import growth_factor
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from tests.scenes import confined_column, strip

GOOD = {"mu": 0.24, "lam": 0.02, "nS0": 0.25, "cfc0": 0.2, "D_plus": 5e-4, "D_minus": 8e-4, "K": 1e-3}


UNCHARGED = Material(**{**GOOD, "cfc0": 0.0})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mu", 0.0), ("mu", -1.0), ("mu", 2.4e5), ("lam", -0.1), ("nS0", 0.0), ("nS0", 1.0), ("nS0", 1.2), ("cfc0", -0.1),
        ("cfc0", 200.0), ("D_plus", 0.0), ("D_minus", -1e-4), ("D_plus", 5e-10), ("K", 0.0), ("K", 1e-15), ("theta", 25.0),
        ("mu", math.nan), ("mu", "0.24"), ("mu", True), ("theta", CF(298.0)), ("mu", CF((1.0, 2.0))),
    ],
)  # fmt: skip
def test_material_out_of_range(name, value):
    with pytest.raises(InputError, match=name):
        Material(**{**GOOD, name: value})


def test_material_field_out_of_range_is_found_on_the_mesh():
    with pytest.raises(InputError, match="nS0"):
        strip(material=Material(**{**GOOD, "nS0": 0.25 + 2 * x / 0.02}))


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
                "material": UNCHARGED,
                "baths": [Bath("top", treatment=Nitsche())],
                "initial": (None, 0.0),
            },
            r"Uncharged has no Nitsche\(.*it has Essential, Penalty",
        ),
        ({"model": Uncharged()}, "cfc0"),
        ({"model": Uncharged(), "material": UNCHARGED}, "takes no concentration"),
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
def test_scene(change, words):
    with pytest.raises(InputError, match=words):
        strip(**change)


@pytest.mark.parametrize("other", [Lagged(), Frozen(), Penalty(1.0), Nitsche(), Multiplier()])
def test_multipliers_stand_beside_baths_that_they_do_not_touch(other):
    baths = [Bath("top", c=0.15, treatment=Multiplier()), Bath("bottom", c=0.15, treatment=other)]
    assert strip(baths=baths, cells=(1, 3)).run(2.0, Fixed(1.0)).rejections == 0


@pytest.mark.parametrize("other", [Penalty(1.0), Nitsche(), Multiplier()])
def test_multipliers_stand_beside_weak_baths_that_they_touch(other):
    baths = [Bath("top", c=0.15, treatment=Multiplier()), Bath("left", c=0.15, treatment=other)]
    scene = strip(baths=baths, cells=(2, 3))
    assert scene.run(2.0, Fixed(1.0)).rejections == 0


def test_multipliers_beside_prescribed_values_would_be_singular(monkeypatch):
    # Control: what is refused cannot be solved.
    monkeypatch.setattr(Scene, "_check_multipliers", lambda scene: None)
    baths = [Bath("top", c=0.15, treatment=Multiplier()), Bath("left", c=0.15, treatment=Lagged())]
    problem = strip(baths=baths, cells=(2, 3)).problem
    problem.initialise()
    rows, columns, values = problem.linearise().COO()
    matrix = np.zeros((problem.vector.size,) * 2)
    matrix[np.array(rows), np.array(columns)] = values
    free = np.flatnonzero(list(problem.free))
    sizes = np.linalg.svd(matrix[np.ix_(free, free)], compute_uv=False)
    # One multiplier of each balance too many, for the corner they share.
    assert sizes[-2] < 1e-15 * sizes[0] < 1e-3 * sizes[-3]


def test_symmetry_needs_a_straight_boundary():
    with pytest.raises(InputError, match="not straight"):
        strip(supports=[Symmetry("left|bottom")])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Bath("top", c=0.0), "= 0 mol/l is outside 1e-12 … 10: for pure water"),
        (lambda: Bath("top", c=-0.15), "-0.15"),
        (lambda: Bath("top", c=150.0), "mol/m³"),
        (lambda: Bath("top", c=Ramp((0, 0.1), (1, -0.1))), "-0.1"),
        (lambda: Bath("top", c=Blend(Ramp((0, 0.1)), Ramp((0, -0.1)), CF(0.5))), "-0.1"),
        (lambda: Bath("top", c=0.15, P=1e6), "1e6 Pa"),
        (lambda: Bath("top", c=0.15, treatment="weak"), "Penalty"),
        (lambda: Penalty(), "relative"),
        (lambda: Penalty(1.0, relative=1.0), "either"),
        (lambda: Penalty(-1.0), "positive"),
        (lambda: Penalty(relative=0.0), "positive"),
        (lambda: Penalty(math.nan), "positive"),
        (lambda: Penalty(0.0), "positive and finite, got 0.0"),
        (lambda: Penalty(relative=-1e3), "positive and finite, got -1000.0"),
        (lambda: Penalty("40"), "positive and finite, got .40."),
        (lambda: Nitsche("20"), "gamma has to be positive and finite, got .20."),
        (lambda: Nitsche(0.0), "adjoint 'symmetric': gamma has to be positive and finite, got 0.0"),
        (lambda: Nitsche(0.0, "none"), "adjoint 'none': gamma has to be positive"),
        (lambda: Nitsche(-1.0, "skew"), "adjoint 'skew': gamma has to be at least 0 and finite, got -1.0"),
        (lambda: Nitsche(math.inf), "finite, got inf"),
        (lambda: Nitsche(math.nan), "finite, got nan"),
        (lambda: Nitsche(adjoint="antisymmetric"), "'antisymmetric' is none of 'symmetric', 'skew', 'none'"),
        (lambda: Bath("top", c=0.15, treatment=Nitsche), r"none of Penalty\(...\), Nitsche\(\), Multiplier\(\)"),
        (lambda: Potential(order=1), r"Potential\(order=1\): order 2 to 6"),
        (lambda: Ramp(), "at least one"),
        (lambda: Ramp((0, 1), (0, 2)), "increase"),
        (lambda: Ramp((5, 1), (4, 2)), "4 s follows 5 s"),
        (lambda: Ramp((0, math.inf)), "finite"),
        (lambda: Traction("top", (0.0, math.nan)), "finite"),
        (lambda: Weight((0.0, -9.81), (0.0, 0.0)), "N/mm³"),
        (lambda: Concentration(order=1), "order"),
        (lambda: Roller("bottom", ""), "direction has to be a name.*got ''"),
        (lambda: Fixed(0.0), "positive"),
        (lambda: Adaptive(tolerance=-1e-3), "positive"),
        (lambda: rectangle(1.0, -1.0, 2, 2), "size = -1 mm is outside"),
        (lambda: column(1.0, 0), "cells 0 is not a whole number"),
        (lambda: Snapshots(-1.0), "interval"),
        # What fuzzing found: other exceptions than these, or nothing, until then.
        (lambda: Material(**{**GOOD, "mu": 10**400}), "mu = inf"),
        (lambda: Material(**{**GOOD, "mu": CF(1j)}), "mu has to be scalar and real"),
        (lambda: Material(**{**GOOD, "nS0": 5e-324}), "nS0 = 5e-324"),
        (lambda: Material(**GOOD, permeability=lambda K, J, nS0: K * math.nan), "permeability .* gives K = nan"),
        (lambda: Material(**GOOD, diffusivity=lambda D, nF: -D), "diffusivity .* gives D = -1"),
        (
            lambda: Material(**GOOD, permeability=lambda K, J, nS0: K * np.exp(J - 1)),
            "permeability .* and of fields",
        ),
        (lambda: Ramp(5), "point has to be some numbers.*got 5"),
        (lambda: Ramp((0, 1, 2)), r"takes points \(time, value\)"),
        (lambda: Ramp(("0", "1")), "component '0'"),
        (lambda: Ramp([(0, 1), (1, 2)]), r"component \(0, 1\)"),
        (lambda: Blend(0.1, 0.2, x), "has to be a Ramp.*got 0.1"),
        (lambda: Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), 2.0), "weight = 2 is outside 0 … 1"),
        (lambda: Bath("top", c="0.1"), "concentration.*number, got '0.1'"),
        (lambda: Bath("top", c=True), "got True"),
        (lambda: Bath("top", c=1e-300), "1e-300 mol/l is outside"),
        (lambda: Bath(3, c=0.1), "boundary has to be a name.*got 3"),
        (lambda: Penalty(10**400), "positive and finite, got 1000"),
        (lambda: Nitsche(adjoint=np.array([1, 2])), "is none of 'symmetric'"),
        (lambda: Potential(2.0), "whole number"),
        (lambda: Traction("top", 1.0), "some numbers.*got 1.0"),
        (lambda: Traction("top", ("a", 0.0)), "component 'a'"),
        (lambda: Weight(np.array([0.0, -9.0]), np.array([0.0, 9.0])), "fluid has a component"),
        (lambda: Pin("ab", "x"), "point.*got 'ab'"),
        (lambda: column("a", 3), "size has to be a number"),
        (lambda: column(1.0, True), "cells True"),
        (lambda: column(1e-300, 3), "1e-300 mm is outside"),
        (lambda: column(1.0, 10**9), "cells 1000000000"),
        (lambda: column(1.0, 3, grade=["top"]), "grade has to be a dictionary"),
        (lambda: rectangle(1.0, 1.0, 3, 3, lines={"x": "a"}), "'x': 'a'"),
        (lambda: rectangle(1.0, 1.0, 1, 1, triangles="no"), "True or False, got 'no'"),
        (lambda: Fixed(math.inf), "finite, got inf"),
        (lambda: Fixed(1.0, "euler"), "scheme has to be BACKWARD_EULER.*'euler'"),
        (lambda: Adaptive(1e300), "above 1"),
        (lambda: Newton(math.nan), "tolerance = nan"),
        (lambda: Newton(most_iterations=0), "most_iterations 0"),
        (lambda: Area(when=math.inf), "interval.*got inf"),
        (lambda: Area(when=[]), "no times"),
        (lambda: Area(when="ab"), "times.*got 'ab'"),
        (lambda: Area(when=1e-300).times(0.0, 10.0), "more than 1000000 records"),
        (lambda: Probe(0.5, "J"), "point.*got 0.5"),
        (lambda: Probe((0.5,), ["J"]), r"quantity.*got \['J'\]"),
        (lambda: VTK(""), "path has to name the series"),
        (lambda: homogeneous_equilibrium(TABLE_1, math.nan, "3-d"), "bath = nan"),
        (lambda: homogeneous_equilibrium(TABLE_1, 0.15, "3-d", load=math.inf), "load = inf"),
        (lambda: Probe((0.0, 0.0)), "at least one quantity"),
        (lambda: homogeneous_equilibrium(TABLE_1, 0.1, "2-d"), "plane strain"),
        (lambda: homogeneous_equilibrium(Material(**{**GOOD, "cfc0": 0.1 + 0 * x}), 0.1, "3-d"), "varies in space"),
    ],
)
def test_parts(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize(
    ("observer", "words"),
    [
        (lambda: Probe((1.0, 0.5), "J"), "not a point"),
        (lambda: Probe((0.5,), "J"), "not a point"),
        (lambda: Probe((0.0, 0.5), "pressure"), "'pressure'.*hydraulic_pressure"),
        (lambda: Integral("density"), "'density'"),
        (lambda: Integral("p", boundary="side"), "'side'"),
        (lambda: Snapshots([20.0]), "outside the run"),
    ],
)
def test_observers(observer, words):
    scene = strip()
    with pytest.raises(InputError, match=words):
        scene.run(10.0, Fixed(5.0), [observer()])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"until": "1"}, "until has to be a number"),
        ({"until": math.inf}, "until = inf"),
        ({"steps": Fixed}, "steps has to be .*got the class Fixed"),
        ({"steps": 1.0}, "steps has to be .*got 1.0"),
        ({"steps": Fixed(1e-14)}, "lost in the round-off"),
        ({"observers": Ledger()}, r"observers has to be a list, got one Ledger: put it in brackets, \["),
        ({"newton": Newton}, "newton has to be .*got the class Newton"),
        ({"resume": 3.0}, "resume has to be a snapshot.*got 3.0"),
        ({"solver": "pardiso"}, "solver has to make a linear solver.*'pardiso'"),
    ],
)
def test_runs(change, words):
    with pytest.raises(InputError, match=words):
        confined_column(cells=2).run(**{"until": 1.0, **change})


def test_a_generator_of_supports_is_kept():
    # It used to be empty after the first look, so that the body seemed free.
    scene = confined_column(cells=2, supports=(support for support in [Roller("bottom", "x")]))
    assert scene.held() == {"x": "bottom"}


def test_until_before_the_start():
    with pytest.raises(InputError, match="not a time after the start"):
        strip(start=100.0).run(50.0)


def test_a_snapshot_of_another_scene():
    end = confined_column().run(1.0, Fixed(1.0)).end
    with pytest.raises(InputError, match="unknowns"):
        strip().run(2.0, Fixed(1.0), resume=end)


def test_growth_needs_a_step_and_a_state_of_its_scene():
    with pytest.raises(InputError, match="positive"):
        growth_factor(strip(Frozen()), 0.0)
    end = confined_column().run(1.0, Fixed(1.0)).end
    with pytest.raises(InputError, match="unknowns"):
        growth_factor(strip(Frozen()), 1.0, end)
    soft = replace(TABLE_1, cfc0=0.0, lam=0.0)
    with pytest.raises(NgswellError, match="does not succeed"):  # crushed: nothing to linearise about
        growth_factor(strip(material=soft, loads=[Traction("top", (0.0, -100.0))]), 1e3)
    with pytest.raises(NgswellError, match="most_steps"):
        growth_factor(strip(Frozen()), 1e-3, most_steps=40)


def test_output_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    for path, words in ((tmp_path / "none" / "a", "no folder"), (tmp_path / "file" / "a", "no folder")):
        with pytest.raises(OutputError, match=words):
            strip().run(1.0, Fixed(1.0), [VTK(path)])
    with pytest.raises(InputError, match="'density'"):
        strip().run(1.0, Fixed(1.0), [VTK(tmp_path / "a", "density")])
    with pytest.raises(InputError, match="1-d"):
        confined_column().run(1.0, Fixed(1.0), [VTK(tmp_path / "a")])
    assert not list(tmp_path.glob("a*"))


def test_nothing_is_overwritten_unasked(tmp_path):
    scene = strip()
    scene.run(2.0, Fixed(1.0), [VTK(tmp_path / "run")])
    before = sorted((f.name, f.stat().st_mtime_ns) for f in tmp_path.iterdir())
    with pytest.raises(OutputError, match="overwrite=True"):
        scene.run(2.0, Fixed(1.0), [VTK(tmp_path / "run")])
    assert sorted((f.name, f.stat().st_mtime_ns) for f in tmp_path.iterdir()) == before
    scene.run(1.0, Fixed(1.0), [VTK(tmp_path / "run", overwrite=True)])
    assert len(list(tmp_path.glob("run*.vtu"))) == 2  # the old third record is gone


def test_refusals_leave_nothing_behind():
    scene = strip()
    with pytest.raises(InputError):
        scene.run(1.0, Fixed(1.0), [Ledger(), Probe((9.0, 9.0), "J")])
    assert scene.run(1.0, Fixed(1.0)).steps[-1].time == 1.0


def test_kinematics_are_interchangeable_only_where_they_fit():
    with pytest.raises(InputError, match="PlaneStrain needs a 2-d mesh"):
        Scene(mesh=column(1.0, 2), kinematics=PlaneStrain(), material=TABLE_1, baths=[Bath("top", c=0.1)])
