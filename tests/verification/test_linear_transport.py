"""Coupled transport of fluid and ions against closed forms (`closed_forms.linear_column`, docs/linear_column.md)."""

import warnings
from dataclasses import replace
from functools import cached_property

import numpy as np
import pytest
from ngsolve import CF, cos, sin, x

from ngswell import (
    TABLE_1,
    Bath,
    Concentration,
    Confined,
    DampedNewton,
    Fixed,
    Frozen,
    InputError,
    Ledger,
    Multiplier,
    Nitsche,
    Penalty,
    Potential,
    Probe,
    Ramp,
    Roller,
    Scene,
    Traction,
    UnitsWarning,
    column,
)
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.closed_forms.linear_column import (
    LinearColumn,
    conductance,
    diffusivities,
    penalty_efflux,
    potentials,
    storage,
    uniform_gel_fluxes,
)
from ngswell.physics import donnan, laws
from ngswell.setup.snapshot import Snapshot
from tests.scenes import P0, confined_column

HEIGHT, BATH = 0.5, 0.15  # mm, mol/l
CLOSED = LinearColumn(TABLE_1, BATH, HEIGHT)
EXACT = DampedNewton(tolerance=1e-12)  # the signals are 1e-5 of the fields
PLACES = np.array([0.0, 0.125, 0.25, 0.375])  # mm; nodes of every mesh below
FIELDS = ("J", "p", "cfc", "c_plus")


# -- the matrices of the closed form -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("material", "bath"), [(TABLE_1, 0.15), (TABLE_1, 2.0), (replace(TABLE_1, cfc0=0.0), 0.15)])
def test_storage_is_the_slope_of_the_equilibria(material, bath):
    load = donnan.pressure(bath, float(material.cfc0), material.RT)

    def contents(salt, hydraulic):
        rest = homogeneous_equilibrium(material, bath + salt, "confined", hydraulic, load - hydraulic)
        return np.array([rest.J, (rest.J - material.nS0) * rest.c])

    def slope(salt, hydraulic):
        return (contents(salt, hydraulic) - contents(-salt, -hydraulic)) / 2

    # Central differences of 1e-5: 1e-10 of truncation, 1e-15/1e-5 of round-off.
    C = storage(material, bath)
    for change in ((1e-5 * bath, 0.0), (0.0, 1e-5 * load + 1e-6)):
        assert slope(*change) == pytest.approx(C @ potentials(material, bath, *change), rel=1e-8, abs=2e-15)


@pytest.mark.parametrize("D_minus", [0.2e-3, 0.8e-3])
def test_conductance_is_that_of_the_flux_laws(D_minus):
    material = replace(TABLE_1, D_minus=D_minus)
    c, cfc, J, RT = donnan.cations(BATH, 0.2), 0.2, 1.0, TABLE_1.RT
    grad_P, grad_S = 0.7, -1.3
    grad_c = BATH**2 / (RT * (2 * c - cfc)) * grad_S  # c̃² = c (c − cfc) at a uniform charge
    grad_p = grad_P + 2 * RT * grad_c
    mesh = column(1.0, 1)
    flux = laws.transport(material, *(CF(value) for value in (J, c, cfc, grad_p, grad_c, 0.0)))
    found = np.array([flux.fluid(mesh(0.5)), flux.cations(mesh(0.5))])
    assert found == pytest.approx(-conductance(material, BATH) @ [grad_P, grad_S], rel=1e-12)
    assert flux.anions(mesh(0.5)) == pytest.approx(found[1], rel=1e-12)  # no current


def test_where_osmosis_turns_negative():
    # c* = c̄ at c̄ = cfc (1 − r²)/(4 r), r = (D₋ − D₊)/(D₋ + D₊): 0.205 mol/l for Table 1.
    r = 0.3 / 1.3
    bath = 0.2 * (1 - r * r) / (4 * r)
    L = conductance(TABLE_1, bath)
    assert L[0, 1] / L[0, 0] == pytest.approx(bath, rel=1e-12)
    below, above = (uniform_gel_fluxes(TABLE_1, factor * bath, 1.0, salt=0.01)[0] for factor in (0.9, 1.1))
    assert below < 0 < above


def test_a_gel_without_charge_consolidates_and_diffuses_separately():
    material = replace(TABLE_1, cfc0=0.0)
    found, _ = diffusivities(storage(material, BATH), conductance(material, BATH))
    consolidation, diffusion = 1.07e-3 * (2 * 0.24 + 0.02), 2 * 0.5e-3 * 0.8e-3 / 1.3e-3
    assert found == pytest.approx(sorted([consolidation, diffusion]), rel=1e-12)


def test_the_series_ends_at_the_linearised_equilibrium():
    change = 1e-5 * BATH
    ends = [homogeneous_equilibrium(TABLE_1, BATH + sign * change, "confined", load=P0) for sign in (1, -1)]
    slope = HEIGHT * (ends[0].J - ends[1].J) / 2
    assert CLOSED.top_displacement(1e5, salt=change) == pytest.approx([slope], rel=1e-8)
    assert CLOSED.profiles([0.1], 1e5, salt=change)["c_plus"] == pytest.approx([(ends[0].c - ends[1].c) / 2], rel=1e-8)


def test_what_the_closed_form_cannot_mean_is_refused():
    with pytest.raises(InputError, match="height has to be positive"):
        LinearColumn(TABLE_1, BATH, 0.0)
    with pytest.raises(InputError, match="bath = 0 mol"):
        LinearColumn(TABLE_1, 0.0, HEIGHT)
    with pytest.raises(InputError, match="mu varies in space"):
        LinearColumn(replace(TABLE_1, mu=CF(0.24)), BATH, HEIGHT)
    with pytest.raises(InputError, match="times > 0"):
        CLOSED.top_displacement([0.0, 1.0], salt=1e-6)
    with pytest.raises(InputError, match="multiples"):
        CLOSED.top_displacement(1.0, salt=1e-6, step=0.3)


# -- decay rates -------------------------------------------------------------------------------------------------------


def discrete_rates(count, dt=100.0, **changes):
    """The `count` smallest decay rates [1/s] of the discrete system, from its tangents at two time steps."""
    problem = confined_column(**changes).problem
    problem.initialise()
    free = np.flatnonzero(list(problem.free))

    def tangent(step):
        problem.dt.Set(step)
        rows, columns, values = problem.linearise().COO()
        matrix = np.zeros((problem.vector.size,) * 2)
        matrix[np.array(rows), np.array(columns)] = values
        return matrix[np.ix_(free, free)]

    once, twice = tangent(dt), tangent(2 * dt)  # R + M/Δt and R + M/2Δt
    factors = np.linalg.eigvals(np.linalg.solve(once, 2 * (once - twice)))  # of one step: 1/(1 + rate Δt)
    slowest = np.sort_complex(factors)[::-1][:count]
    assert np.abs(slowest.imag).max() < 1e-10  # real, as the closed form says
    return (1 / slowest.real - 1) / dt


def closed_rates(count):
    return np.sort(CLOSED.decay_rates(count).ravel())[:count]


@pytest.mark.parametrize(("order", "cells", "share"), [(2, 10, 1 / 12), (3, 5, 1 / 720)])
def test_slowest_decay_rates(order, cells, share):
    """Both branches, n = 0 and 1: the dispersion of linear (quadratic) p and c, (αh)²/12 ((αh)⁴/720), and its order."""

    def errors(cells):
        found = discrete_rates(4, cells=cells, model=Concentration(order=order), treatment=Penalty(relative=1e6))
        shift = CLOSED.penalty_shift(1e6, HEIGHT / cells)  # 1e-7: as much as quadratics on 20 cells leave
        return found / closed_rates(4) - 1 - np.tile(shift, 2)

    coarse, fine = errors(cells), errors(2 * cells)
    wave = np.pi / (2 * HEIGHT) * np.array([1, 1, 3, 3])
    # Leading terms; at n = 1 on the fine mesh αh is 0.24 (0.47), the next ones (αh)² of them or less.
    assert fine == pytest.approx(share * (wave * HEIGHT / (2 * cells)) ** (2 * order - 2), rel=0.05)
    assert np.log2(coarse / fine) == pytest.approx(np.full(4, 2.0 * order - 2), abs=0.1)


def test_decay_rates_to_round_off():
    found = discrete_rates(4, cells=20, model=Concentration(order=5), treatment=Penalty(relative=1e6))
    shift = np.tile(CLOSED.penalty_shift(1e6, HEIGHT / 20), 2)
    # Quartic p and c leave (αh)⁸ of a small share, round-off 1e-16 times the penalty's 1e6.
    assert found / closed_rates(4) - 1 == pytest.approx(shift, abs=1e-10)


EXACT_BATHS = {
    "Potential": {"model": Potential(order=5), "treatment": None},
    "Multiplier": {"model": Concentration(order=5), "treatment": Multiplier()},
    "Nitsche": {"model": Concentration(order=5), "treatment": Nitsche()},
}


@pytest.mark.parametrize("name", EXACT_BATHS)
def test_decay_rates_with_baths_that_are_met_exactly(name):
    found = discrete_rates(4, cells=20, **EXACT_BATHS[name])
    # No penalty shifts the rates (−1.5e-7 above). Quartic fields leave (αh)⁸ of a small share; measured 1e-12, as
    # much as round-off.
    assert found / closed_rates(4) - 1 == pytest.approx(np.zeros(4), abs=1e-11)


@pytest.mark.parametrize(("order", "cells", "share"), [(2, 10, 1 / 12), (3, 5, 1 / 720)])
def test_slowest_decay_rates_of_the_virtual_bath(order, cells, share):
    """The dispersion of linear (quadratic) P and c̃ is that of p and c: at a uniform state one set is linear in the other."""
    coarse, fine = (
        discrete_rates(4, cells=n, model=Potential(order=order), treatment=None) / closed_rates(4) - 1
        for n in (cells, 2 * cells)
    )
    wave = np.pi / (2 * HEIGHT) * np.array([1, 1, 3, 3])
    assert fine == pytest.approx(share * (wave * HEIGHT / (2 * cells)) ** (2 * order - 2), rel=0.05)
    assert np.log2(coarse / fine) == pytest.approx(np.full(4, 2.0 * order - 2), abs=0.1)


def test_penalty_slows_the_decay_as_predicted():
    def rates(relative):
        return discrete_rates(2, cells=10, model=Concentration(order=3), treatment=Penalty(relative=relative))

    cell = HEIGHT / 10
    shift = rates(1e3) / rates(1e7) - 1
    assert shift == pytest.approx(CLOSED.penalty_shift(1e3, cell), rel=1e-3)  # next order: shift² ~ 1e-7 of 1e-4
    assert np.abs(CLOSED.penalty_shift(1e6, cell)).max() < 3e-7  # the bias of Penalty(relative=1e6)


UNCOUPLED = {
    "storage": (np.diag(np.diag(CLOSED.storage)), CLOSED.conductance),
    "fluxes": (CLOSED.storage, np.diag(np.diag(CLOSED.conductance))),
    "both": (np.diag(np.diag(CLOSED.storage)), np.diag(np.diag(CLOSED.conductance))),
}


@pytest.mark.parametrize("neglected", UNCOUPLED)
def test_rates_without_coupling_are_wrong(neglected):
    # Negative control: off-diagonal terms left out of the closed form move both rates by far more than 1e-4, the accuracy
    # of the tests above.
    wrong, _ = diffusivities(*UNCOUPLED[neglected])
    right, _ = diffusivities(CLOSED.storage, CLOSED.conductance)
    assert np.abs(wrong / right - 1).min() > 0.04


@pytest.mark.parametrize("n", [0, 1])
@pytest.mark.parametrize("k", [0, 1])
def test_each_mode_decays_alone(k, n):
    """The run, started in one mode: every field falls by 1/(1 + rate Δt) a step."""
    dt, count, wave = 4.0, 10, (2 * n + 1) * np.pi / (2 * HEIGHT)
    size = {name: float(value) for name, value in CLOSED.mode(k, n, 0.0).items()}  # of the cosines
    shapes = [size["J"] / wave * sin(wave * x), *(size[name] * cos(wave * x) for name in ("p", "c_plus", "cfc"))]

    def records(amplitude):
        scene = confined_column(Penalty(relative=1e6), cells=20, model=Concentration(order=3))
        problem = scene.problem
        problem.initialise()
        rest = problem.vector.copy()
        for component, shape in zip(problem.fields.components, shapes, strict=True):
            component.Set(amplitude * shape)
        problem.vector[:] += rest
        probe = Probe((0.0,), *FIELDS)
        scene.run(count * dt, Fixed(dt), [probe], EXACT, resume=Snapshot(0.0, problem.vector.copy()))
        return np.array([probe.values[name].ravel() for name in FIELDS])

    change = (records(1e-5) - records(-1e-5)) / 2  # of both signs: the square of the perturbation drops out
    left = (change[:, -1] / change[:, 0]) ** (1 / count)
    # (αh)⁴/720 = 4e-6 of the rate at n = 1, and as much again from the interpolated shape not being the discrete mode's.
    assert (1 / left - 1) / dt == pytest.approx(np.full(4, CLOSED.decay_rates(2)[n, k]), rel=3e-5)


# -- the step of the bath ----------------------------------------------------------------------------------------------


def column_run(change, until, dt, cells=20, order=3, relative=1e6, treatment=None, model=None):
    """Fields at PLACES (last time) and the top's displacement (all times) after the bath's step c̄ → c̄ (1 + change)."""
    treatment = treatment or (Penalty(relative=relative) if model is None else None)
    scene = confined_column(
        treatment, c=BATH * (1 + change), cells=cells, initial=(BATH, 0.0), model=model or Concentration(order=order)
    )
    top, probes = Probe((HEIGHT,), "displacement"), [Probe((place,), *FIELDS) for place in PLACES]
    scene.run(until, Fixed(dt), [top, *probes], EXACT)
    fields = {name: np.array([np.diff(probe.values[name].ravel()[[0, -1]])[0] for probe in probes]) for name in FIELDS}
    return {"top": top.values["displacement"].ravel()[1:], **fields}


def response(change=1e-5, **run):
    """Half the difference of both signs of the step: what is even in the perturbation drops out."""
    plus, minus = column_run(change, **run), column_run(-change, **run)
    return {name: (plus[name] - minus[name]) / 2 for name in plus}


def closed_response(until, dt, change=1e-5, step=None, column=CLOSED):
    times = dt * np.arange(1, round(until / dt) + 1)
    profiles = column.profiles(PLACES, until, salt=change * BATH, step=step)
    return {"top": column.top_displacement(times, salt=change * BATH, step=step), **profiles}


def deviations(found, closed):
    """Largest difference of each quantity, relative to its largest value."""
    return np.array([np.abs(found[name] - closed[name]).max() / np.abs(closed[name]).max() for name in closed])


@pytest.mark.parametrize(("order", "cells"), [(2, 16), (3, 8)])
def test_step_of_the_bath_converges_in_space(order, cells):
    """The history of the top, and profiles after 50 s, against the series of backward Euler: only the mesh differs.

    Order 2 for linear p and c; 4 for quadratic ones, at nodes.
    """
    run = {"until": 50.0, "dt": 5.0}
    closed = closed_response(**run, step=5.0)
    coarse, fine = (deviations(response(**run, order=order, cells=n), closed) for n in (cells, 2 * cells))
    # The layer of the first step, sqrt(κ Δt) = 0.05 mm, spans a cell or two: the top's history is not yet asymptotic.
    assert np.log2(coarse / fine) == pytest.approx(np.full(5, 2.0 * order - 2), abs=0.25)
    assert fine.max() < (3e-3 if order == 2 else 1e-4)


def test_step_of_the_bath_to_the_bias_of_the_penalty():
    run = {"until": 50.0, "dt": 5.0}
    found = response(**run, order=4, cells=20)
    # The penalty slows all by 1.5e-7 (test above); order 4 leaves as much in the layer of the first step.
    assert deviations(found, closed_response(**run, step=5.0)).max() < 3e-7


@pytest.mark.parametrize("model", [Potential(5), Concentration(5)])
def test_step_of_the_bath_without_bias(model):
    treatment = Multiplier() if isinstance(model, Concentration) else None
    run = {"until": 50.0, "dt": 5.0}
    found = response(**run, cells=20, model=model, treatment=treatment)
    # Quartic fields: the mesh leaves 1e-9 or less in the layer of the first step; round-off of 1e-16/1e-6 as much.
    assert deviations(found, closed_response(**run, step=5.0)).max() < 2e-9


def test_step_of_the_bath_converges_in_time():
    """Top, and profiles at 120 s, against the exact series: order 1, the error of the mesh (1e-6) far below."""

    def errors(dt):
        found, closed = response(until=120.0, dt=dt), closed_response(until=120.0, dt=dt)
        return np.array([found["top"][-1] / closed["top"][-1] - 1, *(found[n][0] / closed[n][0] - 1 for n in FIELDS)])

    middle, fine = errors(2.0), errors(1.0)
    assert np.log2(np.abs(middle / fine)) == pytest.approx(np.ones(5), abs=0.1)
    assert np.abs(2 * fine - middle).max() < 0.1 * np.abs(fine).max()  # extrapolated to Δt = 0
    assert np.abs(fine).max() < 1e-2


def test_nonlinearity_falls_with_the_step_of_the_bath():
    """One sign alone differs from the series by a share that is proportional to the step of the bath."""
    run = {"until": 50.0, "dt": 5.0}

    def share(change):
        return deviations(column_run(change, **run, order=4), closed_response(**run, change=change, step=5.0))

    large, small = share(-1e-2), share(-1e-3)
    assert large / small == pytest.approx(np.full(5, 10.0), rel=0.05)  # the next term: some times the step, 1e-2
    assert small.max() < 1e-3


def test_the_step_without_coupling_or_with_a_frozen_charge_is_wrong():
    """Negative controls: fluxes without cross terms in the closed form, and a bath that does not see the deformation."""

    class Uncoupled(LinearColumn):
        @cached_property
        def conductance(self):
            return UNCOUPLED["fluxes"][1]

    run = {"until": 50.0, "dt": 5.0}
    wrong = closed_response(**run, step=5.0, column=Uncoupled(TABLE_1, BATH, HEIGHT))
    assert deviations(response(**run), wrong).min() > 0.5
    frozen = response(**run, treatment=Frozen())
    assert deviations(frozen, closed_response(**run, step=5.0)).min() > 0.15


# -- salt alone --------------------------------------------------------------------------------------------------------


def salt_series(places, time, dt, start, end, diffusivity):
    """c(x, t) of ∂c/∂t = D ∂²c/∂x², sealed at 0, `end` at HEIGHT from 0 on; by backward Euler, exactly if dt is None."""
    wave = (2 * np.arange(4000) + 1) * np.pi / (2 * HEIGHT)
    rate = diffusivity * wave**2
    left = np.exp(-rate * time) if dt is None else (1 + rate * dt) ** -round(time / dt)
    weights = 2 * (-1.0) ** np.arange(4000) / (wave * HEIGHT) * left
    return end + (start - end) * np.cos(np.outer(places, wave)) @ weights


def salt_run(end, until=100.0, dt=5.0, cells=20, order=3, **changes):
    scene = Scene(
        **{
            "mesh": column(HEIGHT, cells),
            "kinematics": Confined(),
            "material": replace(TABLE_1, cfc0=0.0),
            "model": Concentration(order=order),
            "supports": [Roller("bottom", "x")],
            "baths": [Bath("top", c=end, treatment=Penalty(relative=1e6))],
            "initial": (BATH, 0.0),
            **changes,
        }
    )
    probes = [Probe((place,), "c_plus", "c_minus", "p", "J") for place in PLACES]
    scene.run(until, Fixed(dt), probes, EXACT)
    return {name: np.array([probe.values[name].ravel()[-1] for probe in probes]) for name in ("c_plus", "c_minus", "p", "J")}


AMBIPOLAR = 2 * TABLE_1.D_plus * TABLE_1.D_minus / (TABLE_1.D_plus + TABLE_1.D_minus)


@pytest.mark.parametrize("end", [0.1499, 0.03])
def test_salt_diffuses_with_the_ambipolar_diffusivity(end):
    """Without charge no fluid moves and the equation of the salt is linear: exact for small steps and for large ones."""
    found = salt_run(end)
    closed = salt_series(PLACES, 100.0, 5.0, BATH, end, AMBIPOLAR)
    # What is left after 100 s are n = 0 and 1, whose rates err (αh)⁴/720 = 5e-8 and 4e-6: 1e-7; the penalty adds 5e-8.
    assert np.abs(found["c_plus"] - closed).max() < 5e-7 * (BATH - end)
    assert found["c_minus"] == pytest.approx(found["c_plus"], rel=1e-12)
    assert np.abs(found["J"] - 1).max() < 1e-13  # p = P̄ = 0: nothing deforms
    assert np.abs(found["p"]).max() < 1e-13
    # Negative controls: the porosity as a factor, the mean of both diffusivities, one ion's alone.
    for wrong in (0.75 * AMBIPOLAR, 0.65e-3, 0.5e-3, 0.8e-3):
        series = salt_series(PLACES, 100.0, 5.0, BATH, end, wrong)
        assert np.abs(found["c_plus"] - series).max() > 1e-2 * (BATH - end)


def test_salt_diffusion_orders():
    end = 0.1

    def in_space(cells):
        closed = salt_series(PLACES, 100.0, 5.0, BATH, end, AMBIPOLAR)
        return np.abs(salt_run(end, cells=cells, order=2)["c_plus"] - closed).max()

    def in_time(dt):
        return np.abs(salt_run(end, dt=dt)["c_plus"] - salt_series(PLACES, 100.0, None, BATH, end, AMBIPOLAR)).max()

    assert np.log2(in_space(8) / in_space(16)) == pytest.approx(2.0, abs=0.15)
    assert np.log2(in_time(5.0) / in_time(2.5)) == pytest.approx(1.0, abs=0.1)


def test_a_charge_switched_off_is_no_charge():
    off = salt_run(0.1, material=TABLE_1, charge=Ramp((0, 0.0)))
    none = salt_run(0.1)
    for name, values in none.items():
        assert off[name] == pytest.approx(values, abs=1e-12)


# -- a gel between two baths -------------------------------------------------------------------------------------------

THICKNESS, GEL_CELLS = 0.5, 10  # mm
STIFF = replace(TABLE_1, mu=1e4)  # strains of 1e-5: the gel stays uniform


def steady_fluxes(material, bath, salt=0.0, hydraulic=0.0):
    """Steady fluxes of fluid and cations away from the top's bath; the baths differ by `salt` and `hydraulic`, half each."""
    load = donnan.pressure(bath, float(material.cfc0), material.RT)
    weak = Penalty(relative=1e6)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnitsWarning)  # a rigid gel is meant
        scene = Scene(
            mesh=column(THICKNESS, GEL_CELLS),
            kinematics=Confined(),
            material=material,
            model=Concentration(),
            supports=[Roller("bottom", "x")],
            baths=[
                Bath("top", c=bath + salt / 2, P=hydraulic / 2, treatment=weak, porous_plate=True),
                Bath("bottom", c=bath - salt / 2, P=-hydraulic / 2, treatment=weak),
            ],
            loads=[Traction("top", (-load,))],
            initial=(bath, 0.0),
        )
    ledger, dt = Ledger(), 1e4
    scene.run(8 * dt, Fixed(dt), [ledger], EXACT)  # rate × Δt > 50 a step: (1/50)⁸ is left
    left = [(ledger.fluid_left[side], ledger.cations_left[side]) for side in ("top", "bottom")]
    top, bottom = (np.array([np.diff(values)[-1] / dt for values in side]) for side in left)
    # What enters leaves, to some units in the last place of p, 3e-17 N/mm², times ε = 2e4 mm³/(N s).
    assert np.abs(top + bottom).max() < 2e-11
    return -top


def closed_fluxes(material, bath, **differences):
    return np.array(uniform_gel_fluxes(material, bath, THICKNESS, **differences))


@pytest.mark.parametrize("bath", [0.15, 0.5])
def test_streaming_potential_holds_the_fluid_back(bath):
    """(a) A pressure difference between equal baths. Ions stay uniform, so the closed form is exact for a rigid gel."""
    found = steady_fluxes(STIFF, bath, hydraulic=0.1)
    assert found == pytest.approx(closed_fluxes(STIFF, bath, hydraulic=0.1), rel=5e-7)  # the penalty's bias: 1.5e-7 to 4e-7
    # With it, resistances in series: gel, and G⁻¹ at each end. Left are the strain, 1e-5 · (P̄/2µ), and round-off, 1e-8.
    resistance = THICKNESS * np.linalg.inv(conductance(STIFF, bath))
    resistance += 2 * np.linalg.inv(penalty_efflux(STIFF, bath, 1e6, THICKNESS / GEL_CELLS))
    wanted = np.linalg.solve(resistance, potentials(STIFF, bath, hydraulic=0.1))
    assert found == pytest.approx(wanted, rel=5e-8)
    # Negative control: Darcy's law alone gives 1.69 (1.22) times the fluid.
    assert TABLE_1.K * 0.1 / THICKNESS / found[0] > 1.2


def test_streaming_in_a_soft_gel_differs_by_its_deformation():
    """(a) for Table 1 itself: what strain does to the fluxes is even in P̄ and falls with its square."""

    def share(hydraulic):
        found = steady_fluxes(TABLE_1, BATH, hydraulic=hydraulic)
        return found / closed_fluxes(TABLE_1, BATH, hydraulic=hydraulic) - 1

    large, small = share(0.1), share(0.05)
    assert large / small == pytest.approx([4.0, 4.0], rel=0.01)  # shares of 1e-3 and 2.5e-4, bias 4e-7
    assert np.abs(small).max() < 3e-4


def per_salt(material, bath, fraction):
    """Fluxes per difference of salt, at a difference of `fraction` of the bath."""
    return steady_fluxes(material, bath, salt=fraction * bath) / (fraction * bath)


def limit_per_salt(material, bath):
    """The same for small differences, extrapolated: fluxes are odd in the difference, so the error is its square."""
    return (4 * per_salt(material, bath, 0.05) - per_salt(material, bath, 0.1)) / 3


@pytest.mark.parametrize(("bath", "osmosis"), [(0.15, 1), (0.5, -1)])
def test_osmosis_and_its_sign(bath, osmosis):
    """(b) A salt difference at equal hydraulic pressure: fluid moves towards the salt where c* < c̄, and away from it, by
    the diffusion potential of D₋ > D₊, where c* > c̄; salt always moves away from it."""
    closed = closed_fluxes(STIFF, bath, salt=1.0)
    large, small = per_salt(STIFF, bath, 0.1), per_salt(STIFF, bath, 0.05)
    assert np.sign(small[0]) == -osmosis
    assert small[1] > 0
    assert (large / closed - 1) / (small / closed - 1) == pytest.approx([4.0, 4.0], rel=0.05)
    assert np.abs(small / closed - 1).max() < 2e-3
    # Round-off of the fluxes, 1e-12 of 2e-6, and the fourth power of the difference, 1e-6.
    assert limit_per_salt(STIFF, bath) == pytest.approx(closed, rel=5e-6)


def test_swapped_diffusivities_turn_negative_osmosis_around():
    swapped = replace(STIFF, D_plus=STIFF.D_minus, D_minus=STIFF.D_plus)
    assert per_salt(STIFF, 0.5, 0.05)[0] > 0
    assert per_salt(swapped, 0.5, 0.05)[0] < 0
    assert limit_per_salt(swapped, 0.5) == pytest.approx(closed_fluxes(swapped, 0.5, salt=1.0), rel=5e-6)


def test_reciprocity():
    """Salt carried per pressure (a) and fluid moved per potential of the salt (b): one number (Onsager), measured twice."""
    by_pressure = steady_fluxes(STIFF, BATH, hydraulic=0.1) / 0.1
    by_salt = limit_per_salt(STIFF, BATH)
    P, S = potentials(STIFF, BATH, salt=1.0)
    assert (by_salt[0] - by_pressure[0] * P) / S == pytest.approx(by_pressure[1], rel=5e-6)
