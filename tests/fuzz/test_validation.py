"""Arguments of every kind: a sound piece, or an InputError (OutputError) that names what is wrong; nothing else."""

from __future__ import annotations

from dataclasses import fields, replace
from math import inf, isfinite, nan

import numpy as np
import pytest
from hypothesis import example
from hypothesis import strategies as st
from ngsolve import CF, Mesh, x

from ngswell import (
    BACKWARD_EULER,
    ESDIRK4,
    TABLE_1,
    VTK,
    Adaptive,
    Area,
    Averaged,
    Bath,
    Blend,
    Coarseness,
    Concentration,
    Confined,
    DampedNewton,
    Efflux,
    Essential,
    FibreDistribution,
    FibreReinforced,
    Fibres,
    Fixed,
    HolmesMow,
    HolmesMowSolid,
    InnerLayer,
    InputError,
    Integral,
    Lagged,
    LeastSquares,
    Ledger,
    LocalDonnan,
    MackieMeares,
    Material,
    MooneyRivlin,
    Multiplier,
    NeoHookean,
    Nitsche,
    Obstacle,
    Orthotropic,
    Penalty,
    PETScSolver,
    Pin,
    PlaneStrain,
    Platen,
    Potential,
    PowerLaw,
    Pressure,
    Probe,
    Progress,
    Ramp,
    Reaction,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Roller,
    Scene,
    Snapshots,
    Symmetry,
    Traction,
    TransverselyIsotropic,
    Uncharged,
    Vessel,
    Weight,
    box,
    column,
    ray,
    rectangle,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.observers.base import Observer
from ngswell.physics.pores import Constant
from ngswell.physics.ranges import RANGES
from tests.fuzz.fuzzing import JUNK, NUMBERS, SCALE, attempt, built, fault, fuzzed, generated, log_uniform, named

PARAMETERS = tuple(field.name for field in fields(Material) if field.name in RANGES)
FIELDS = PARAMETERS[:7]
LAWS = {"permeability": [Constant(), PowerLaw(2.0), HolmesMow(1.0, 2.0)], "diffusivity": [Constant(), MackieMeares()]}


def in_range(name: str) -> st.SearchStrategy[float]:
    found = RANGES[name]
    zero = [st.just(0.0)] if found.zero else []
    return st.one_of(log_uniform(max(found.low, 1e-6) if found.low == 0 else found.low, found.high), *zero)


def about(name: str) -> st.SearchStrategy[float]:
    """Numbers within the range, on its edges, a rounding inside and outside of them, and far beyond."""
    low, high = RANGES[name][:2]
    edges = [np.nextafter(edge, to) for edge in (low, high) for to in (-inf, inf)]
    return st.one_of(in_range(name), st.sampled_from([low, high, *map(float, edges), 0.0, -0.0, -low, 1e3 * high]), NUMBERS)


MATERIALS = st.fixed_dictionaries({name: in_range(name) for name in PARAMETERS}).map(lambda values: Material(**values))


@fuzzed(
    1500,
    values=st.fixed_dictionaries({name: about(name) for name in PARAMETERS}),
    faults=st.sets(st.sampled_from(PARAMETERS)),
)
def test_a_material_is_within_its_ranges_or_refused(values, faults):
    values = {name: value if name in faults else RANGES[name].high for name, value in values.items()}

    def inside(name, value):
        found = RANGES[name]
        value = float(value) if isinstance(value, np.floating) else value
        return found.low <= value <= found.high or (found.zero and value == 0)

    wrong = [name for name, value in values.items() if not inside(name, value)]
    material, message = attempt(lambda: Material(**values))
    if material is None:
        assert wrong, f"refused without a reason: {message}"
        assert any(f"{name} " in message for name in wrong)
    else:
        assert not wrong, f"{wrong} accepted"
        assert all(type(getattr(material, name)) is float for name in PARAMETERS)


@fuzzed(700, name=st.sampled_from([*PARAMETERS, *LAWS]), value=JUNK)
@example(name="mu", value=CF(1j))
@example(name="permeability", value=lambda K, J, nS0: K * nan)
@example(name="diffusivity", value=lambda D, nF: -D)
@example(name="permeability", value=lambda K, J, nS0: K * np.exp(J - 1))
@example(name="permeability", value=lambda K, J, nS0: K / (J - 1))
def test_what_is_no_parameter_is_refused_by_name(name, value):
    good = {name: RANGES[name].high for name in PARAMETERS}
    material, message = attempt(lambda: Material(**{**good, name: value}))
    if material is None:
        assert name in message
    else:
        assert not fault(material)


@fuzzed(60, name=st.sampled_from(FIELDS), value=NUMBERS)
def test_fields_of_position_are_checked_on_the_mesh(name, value):
    found = RANGES[name]
    try:
        number = float(value)
    except OverflowError:  # NGSolve takes no integers beyond a float
        number = inf
    material = replace(TABLE_1, **{name: CF(number)})
    if found.low <= number <= found.high or (found.zero and number == 0):
        material.check_on(MESH)
    else:
        with pytest.raises(InputError, match=name):
            material.check_on(MESH)


# -- pieces ------------------------------------------------------------------------------------------------------------

MESH = rectangle(1.0, 1.0, 1, 1)
SALT = log_uniform(1e-12, 10.0)
PLACES = st.floats(-100.0, 100.0)
NAMES = st.sampled_from(["top", "left|right", "nowhere"])
RAMPS = st.lists(
    st.tuples(st.floats(-1e6, 1e6), SALT), min_size=1, max_size=4, unique_by=lambda point: round(point[0], 9)
).map(lambda points: Ramp(*sorted(points)))
HISTORIES = st.one_of(SALT, RAMPS, st.builds(Blend, RAMPS, RAMPS, st.sampled_from([x, CF(0.5), 0.25])))
TREATMENTS = st.sampled_from([None, Essential(), Penalty(relative=1e3), Nitsche(), Multiplier(), Lagged(InnerLayer())])
SIZES = log_uniform(1e-6, 1e6)
CELLS = st.integers(1, 3)
NO_CELLS = st.one_of(JUNK.filter(lambda value: not isinstance(value, int) or not 3 < value <= 10**7), st.just(10**9))
SCHEMES = st.sampled_from([BACKWARD_EULER, ESDIRK4])
SHAPES = st.sampled_from([RigidPlane((0.0, 2.0), (0.0, -1.0)), RigidSphere((0.0, 3.0), 1.0), RigidCylinder((0.0, 3.0), 1.0)])
WHEN = st.one_of(st.none(), log_uniform(1e-4, 100.0), st.lists(st.floats(0.0, 10.0), min_size=1, max_size=5))

PIECES = {
    Ramp: [st.tuples(st.floats(-1e6, 1e6), SALT)],
    Blend: [RAMPS, RAMPS, st.sampled_from([x, CF(0.5), 0.25])],
    Bath: [NAMES, HISTORIES, st.floats(-1e3, 1e3), TREATMENTS],
    Vessel: [log_uniform(1e-12, 1e12), st.floats(0, 1e3), st.floats(0, 1e3), SALT],
    Penalty: [log_uniform(1e-6, 1e6)],
    Nitsche: [log_uniform(20.0, 1e6), st.sampled_from(["symmetric", "skew", "none"])],
    Lagged: [st.sampled_from([None, InnerLayer(), Averaged(), LeastSquares()])],
    LeastSquares: [st.integers(0, 6), st.tuples(st.floats(0, 10), st.floats(1, 10))],
    PowerLaw: [st.floats(0, 50)],
    HolmesMowSolid: [st.floats(0, 100)],
    Fibres: [st.tuples(st.floats(1, 2), PLACES, PLACES), st.floats(0, 1e6), st.floats(2, 20), st.floats(0, 100)],
    FibreDistribution: [log_uniform(1e-9, 1e6), st.floats(2, 20), st.floats(0, 100)],
    FibreReinforced: [st.just(NeoHookean()), st.just((Fibres((1, 0, 0), 1.0),))],
    TransverselyIsotropic: [st.tuples(st.floats(1, 2), PLACES, PLACES), log_uniform(1e-6, 1e6)],
    Orthotropic: [st.just((1.0, 0.0, 0.0)), st.just((0.0, 1.0, 0.0)), log_uniform(1e-6, 1e6), log_uniform(1e-6, 1e6)],
    MooneyRivlin: [st.floats(0, 1)],
    HolmesMow: [st.floats(0, 50), st.floats(0, 50)],
    Roller: [NAMES, st.sampled_from(["x", "y"]), st.one_of(PLACES, RAMPS, st.tuples(RAMPS))],
    Symmetry: [NAMES],
    Pin: [st.tuples(PLACES, PLACES), st.sampled_from(["x", "xy"])],
    Platen: [NAMES, st.one_of(PLACES, RAMPS), st.none(), st.booleans()],
    Traction: [NAMES, st.tuples(PLACES, st.one_of(PLACES, RAMPS))],
    Pressure: [NAMES, st.one_of(st.floats(-1e3, 1e3), HISTORIES)],
    Efflux: [NAMES, st.one_of(st.floats(1e-3, 1e3), RAMPS), st.one_of(st.floats(-1e3, 1e3), RAMPS)],
    RigidPlane: [st.tuples(PLACES, PLACES), st.sampled_from([(0.0, 1.0), (3.0, -4.0)])],
    RigidSphere: [st.tuples(PLACES, PLACES), log_uniform(1e-6, 1e6)],
    RigidCylinder: [st.tuples(PLACES, PLACES), log_uniform(1e-6, 1e6), st.sampled_from([None, (0.0, 1.0)])],
    Obstacle: [NAMES, SHAPES, st.tuples(st.one_of(PLACES, RAMPS), PLACES), log_uniform(1.0, 1e6)],
    Weight: [st.tuples(st.floats(-1, 1), st.floats(-1, 1)), st.tuples(st.floats(-1, 1), st.floats(-1, 1))],
    Potential: [st.integers(2, 6)],
    Concentration: [st.integers(2, 6)],
    LocalDonnan: [st.integers(2, 6)],
    Uncharged: [st.integers(2, 6)],
    Fixed: [log_uniform(1e-9, 1e9), SCHEMES],
    Adaptive: [log_uniform(1e-9, 1.0), log_uniform(1e-9, 1e9), SCHEMES],
    DampedNewton: [log_uniform(1e-15, 1e-2), st.integers(1, 100), log_uniform(1e-6, 1.0), st.floats(0, 0.9)],
    PETScSolver: [st.sampled_from([None, {}, {"ksp_type": "gmres", "ksp_rtol": 1e-6}])],
    Snapshots: [WHEN],
    Area: [WHEN],
    Coarseness: [WHEN],
    Probe: [st.tuples(PLACES), st.sampled_from(["J", "p"])],
    Integral: [st.sampled_from([None, "J"]), st.sampled_from([None, "top"]), WHEN],
    Reaction: [NAMES, WHEN],
    VTK: [st.sampled_from(["nowhere/series", "series"]), st.sampled_from(["J", "p"])],
    column: [SIZES, CELLS, st.sampled_from([None, {"top": 10.0}])],
    ray: [st.one_of(st.just(0.0), st.floats(1e-9, 1e-7)), SIZES, CELLS, st.sampled_from([None, {"outer": 10.0}])],
    rectangle: [SIZES, SIZES, CELLS, CELLS, st.booleans(), st.sampled_from([None, {"top": 10.0}])],
    box: [SIZES, SIZES, SIZES, CELLS, CELLS, CELLS, st.sampled_from(["hexahedra", "prisms"])],
}
"""Makers of pieces and good arguments for each, in order."""

COUNTS = {column: (1,), ray: (2,), rectangle: (2, 3), box: (3, 4, 5)}
"""Arguments that are numbers of cells: what would take hours and all memory to mesh is not tried."""


@st.composite
def pieces(draw, faults: int):
    make = draw(st.sampled_from(list(PIECES)))
    arguments = [draw(strategy) for strategy in PIECES[make]]
    for place in draw(st.lists(st.integers(0, len(arguments) - 1), min_size=faults, max_size=faults)):
        arguments[place] = draw(NO_CELLS if place in COUNTS.get(make, ()) else wrong(arguments[place]))
    return make, arguments


def wrong(good) -> st.SearchStrategy:
    """Something in place of a good argument: junk, or for tuples the same with junk in one place."""
    if not isinstance(good, tuple) or not good:
        return JUNK
    inside = st.tuples(st.integers(0, len(good) - 1), JUNK).map(
        lambda pair: (*good[: pair[0]], pair[1], *good[pair[0] + 1 :])
    )
    as_array = np.array(good, dtype=None if all(isinstance(entry, (int, float)) for entry in good) else object)
    return st.one_of(JUNK, inside, st.just(list(good)), st.just(as_array), st.just(good + good))


@fuzzed(500, piece=pieces(0))
def test_good_arguments_make_a_piece(piece):
    make, arguments = piece
    assert built(lambda: make(*arguments)) is not None, arguments


@fuzzed(4500, piece=pieces(1))
def test_one_wrong_argument_is_refused_or_makes_a_sound_piece(piece):
    make, arguments = piece
    thing = built(lambda: make(*arguments))
    if isinstance(thing, Observer):
        built(lambda: thing.plan(0.0, 10.0))
    if isinstance(thing, Mesh):
        assert thing.ne <= 54  # two prisms in each of 3 × 3 × 3 boxes


@fuzzed(800, piece=pieces(2))
def test_two_wrong_arguments_are_refused_or_make_a_sound_piece(piece):
    make, arguments = piece
    built(lambda: make(*arguments))


@fuzzed(300, when=st.one_of(JUNK, st.lists(st.floats(), max_size=6), st.lists(st.floats(-1, 12), max_size=6).map(np.array)))
@example(when=1e-300)
@example(when=[])
@example(when=[3.0, 1.0, 3.0])
@example(when=np.array([3.0, 1.0]))
@example(when=np.float32(2.0))
@example(when=inf)
def test_times_of_records_lie_in_the_run(when):
    times, message = attempt(lambda: Area(when=when).plan(0.0, 10.0))
    if times is None:
        assert "Area" in message
    else:
        assert all(isinstance(time, float) and 0 <= time <= 10 for time in times)
        assert times or when is None


# -- scenes and runs ---------------------------------------------------------------------------------------------------

GOOD = {
    "mesh": MESH,
    "kinematics": PlaneStrain(),
    "material": TABLE_1,
    "model": Potential(),
    "supports": [Roller("bottom", "y"), Roller("left", "x")],
    "baths": [Bath("top", c=0.15)],
    "loads": [Traction("top", (0.0, -0.1))],
    "charge": Ramp((0.0, 1.0)),
    "start": 0.0,
    "initial": None,
}
OTHERS = [
    PlaneStrain, Potential, Bath("top", c=0.15), Roller("bottom", "y"), [Bath], [Roller("bottom", "y"), "left"],
    (Bath("top", 1.0),), Traction("top", (0.0, 1.0)), "mesh", MESH.ngmesh, column(1.0, 1), Concentration(), Confined(),
    [None], TABLE_1, Ramp((0, 101.0)), Ramp((0.0, -1e-9)), Blend(Ramp((0, 1.0)), Ramp((0, 0.5)), x), (0.1, 0.0), (0.1,),
    (None, 0.0), (0.1, 0.0, Penalty(1.0)), (0.15, nan), (CF(0.1), 0.0),
    [Bath("top", c=Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), 2 * x))],
    [Bath("top", c=Blend(Ramp((0, 0.1)), Ramp((0, 0.2)), x + nan))], [Bath("t.p", c=0.1)], [Bath("top|", c=0.1)],
    [Bath(".*", 0.1)], [Pin((0.0, 0.0), "xy")], [Weight((0.0,), (0.0, 0.0))], iter([Bath("top", c=0.15)]),
]  # fmt: skip


@fuzzed(400, name=st.sampled_from(list(GOOD)), value=st.one_of(JUNK, st.sampled_from(OTHERS)))
def test_a_scene_takes_pieces_of_its_kinds_only(name, value):
    scene = built(lambda: Scene(**{**GOOD, name: value}))
    if scene is not None:
        assert isinstance(scene.supports, tuple)
        assert isfinite(scene.start)
        assert all(isinstance(bath, Bath) for bath in scene.baths)


RUN = {
    "until": 1.0, "steps": Fixed(1.0), "observers": (), "newton": None, "resume": None, "solver": lambda problem: None,
    "checkpoint": None,
}  # fmt: skip
SCENE = Scene(**GOOD)


@fuzzed(
    400,
    name=st.sampled_from(list(RUN)),
    value=st.one_of(
        JUNK, st.sampled_from([Fixed, Adaptive, DampedNewton, Ledger(), [Ledger], [Progress], [[Ledger()]], SCENE])
    ),
)
def test_a_run_takes_what_it_can_mean_only(name, value):
    # The last thing to be refused is what makes no linear solver.
    if name == "solver" and callable(value):
        return
    with pytest.raises(InputError) as refusal:
        SCENE.run(**{**RUN, name: value})
    sound = {
        "until": isinstance(value, (int, float, np.number)),
        "steps": isinstance(value, Adaptive | Fixed | None),
        "resume": value is None,
        "checkpoint": value is None,
    }
    if "what solver makes" in str(refusal.value):
        assert sound.get(name, True)
    else:
        assert name in str(refusal.value).lower() or "start" in str(refusal.value)


@fuzzed(
    400,
    name=st.sampled_from(["material", "salt", "motion", "hydraulic", "load", "boundary_charge"]),
    value=JUNK,
)
def test_a_closed_form_refuses_what_it_cannot_mean(name, value):
    good = {"material": TABLE_1, "salt": 0.15, "motion": "3-d"}
    built(lambda: homogeneous_equilibrium(**{**good, name: value}))


def test_a_refusal_tells_the_value():
    for make, value in [
        (Fixed, -3.5), (Adaptive, "fine"), (lambda v: Bath("top", c=v), 12.5), (Penalty, nan),
        (lambda v: column(v, 3), -2.0), (lambda v: column(1.0, v), 2.5), (lambda v: Probe((v,), "J"), "a"), (Area, -1.0),
        (DampedNewton, 7.0), (Potential, 9),
        (lambda v: Material(**{**vars(TABLE_1), "K": v}), 1e9),
    ]:  # fmt: skip
        with pytest.raises(InputError) as refusal:
            make(value)
        assert named(str(refusal.value), value), refusal.value


def test_inputs_were_generated():
    # With those of test_laws_fuzzed.py more than 10 000.
    assert generated(__name__) >= 9_000 * min(1.0, SCALE)
