"""Donnan equilibrium, homogeneous equilibria and constitutive laws over their whole admissible range."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, localcontext
from math import exp

import numpy as np
import pytest
from hypothesis import example
from hypothesis import strategies as st
from ngsolve import CF, Det

from ngswell import HolmesMow, MackieMeares, Material, PowerLaw, rectangle
from ngswell.closed_forms.homogeneous import FREE_DIRECTIONS, homogeneous_equilibrium
from ngswell.physics import donnan, laws
from ngswell.physics.material import GAS_CONSTANT
from ngswell.physics.solid import extra_stress
from tests.fuzz.fuzzing import SCALE, attempt, fuzzed, generated, log_uniform

EPS = np.finfo(float).eps
RT = GAS_CONSTANT * 298.0

SALT = log_uniform(1e-12, 10.0)
CHARGE = st.one_of(st.just(0.0), log_uniform(1e-18, 1e6))
"""Charges per fluid volume: 100 times 10 mol/l on a body that is almost crushed, or none."""
GAMMA = st.one_of(st.just(1.0), log_uniform(0.05, 20.0))
PHI = st.one_of(st.just(1.0), log_uniform(0.05, 5.0))

MATERIALS = st.builds(
    Material,
    mu=log_uniform(1e-7, 1e4),
    lam=st.one_of(st.just(0.0), log_uniform(1e-7, 1e5)),
    nS0=st.one_of(st.floats(1e-6, 1 - 1e-6), log_uniform(1e-6, 0.5)),
    cfc0=st.one_of(st.just(0.0), log_uniform(1e-12, 10.0)),
    D_plus=log_uniform(1e-8, 1e-1),
    D_minus=log_uniform(1e-8, 1e-1),
    K=log_uniform(1e-11, 1e5),
    theta=st.floats(200.0, 500.0),
    permeability=st.sampled_from([PowerLaw(0.0), PowerLaw(2.0), HolmesMow(1.0, 2.0)]),
    diffusivity=st.sampled_from([MackieMeares(), lambda D, nF: D]),
    phi=PHI,
    phi_bath=PHI,
    Gamma=GAMMA,
)


# -- equilibrium with a bath -------------------------------------------------------------------------------------------


@fuzzed(2000, bath=SALT, cfc=CHARGE, gamma=GAMMA)
def test_ions_multiply_to_those_of_the_bath_and_are_neutral(bath, cfc, gamma):
    plus, minus = donnan.cations(bath, cfc, gamma), donnan.anions(bath, cfc, gamma)
    assert 0 < minus <= plus * (1 + EPS)
    # Four roundings in c₊, each at most half a unit in the last place, two in the product.
    assert plus * minus == pytest.approx((gamma * bath) ** 2, rel=4 * EPS)
    assert abs((plus - minus) - cfc) <= 6 * EPS * plus


def exact(bath: float, cfc: float, gamma: float, phi: float, phi_bath: float) -> tuple[float, float]:
    """φ sqrt((Γ c̄)² + cfc²/4) − φ̄ c̄ in 60 digits, and the size of what it is the difference of."""
    with localcontext() as context:
        context.prec = 60
        c, q, g, f, h = map(Decimal, (bath, cfc, gamma, phi, phi_bath))
        inside = f * ((g * c) ** 2 + q * q / 4).sqrt()
        return float(inside - h * c), float(inside + h * c)


@fuzzed(1500, bath=SALT, cfc=CHARGE, gamma=GAMMA, phi=PHI, phi_bath=PHI, hydraulic=st.floats(-1e3, 1e3))
@example(bath=1.0, cfc=1e-9, gamma=1.0, phi=1.0, phi_bath=1.0, hydraulic=0.0)  # the difference drowns, but is not negative
def test_the_pressure_is_that_of_38(bath, cfc, gamma, phi, phi_bath, hydraulic):
    difference, size = exact(bath, cfc, gamma, phi, phi_bath)
    osmotic = donnan.pressure(bath, cfc, RT, 0.0, gamma, phi, phi_bath)
    # Relative to what it is the difference of: the bath's own osmotic pressure sets the round-off.
    assert abs(osmotic - 2 * RT * difference) <= 4 * EPS * 2 * RT * size
    assert donnan.pressure(bath, cfc, RT, hydraulic, gamma, phi, phi_bath) == pytest.approx(hydraulic + osmotic, rel=EPS)
    if phi * gamma >= phi_bath and gamma == phi == phi_bath == 1.0:
        assert osmotic >= 0.0


@fuzzed(1000, bath=SALT, cfc=CHARGE, gamma=GAMMA, factor=st.floats(1 + 1e-9, 1e3))
def test_equilibrium_is_monotone(bath, cfc, gamma, factor):
    plus, minus = donnan.cations(bath, cfc, gamma), donnan.anions(bath, cfc, gamma)
    osmotic = donnan.pressure(bath, cfc, RT)
    charged = donnan.cations(bath, factor * cfc, gamma), donnan.anions(bath, factor * cfc, gamma)
    salted = donnan.cations(factor * bath, cfc, gamma), donnan.anions(factor * bath, cfc, gamma)
    slack = 1 + 4 * EPS
    assert charged[0] * slack >= plus
    assert charged[1] <= minus * slack
    assert salted[0] * slack >= plus
    assert salted[1] * slack >= minus
    round_off = 8 * EPS * RT * (factor * bath + factor * cfc)
    assert donnan.pressure(bath, factor * cfc, RT) >= osmotic - round_off  # more charge swells
    assert donnan.pressure(factor * bath, cfc, RT) <= osmotic + round_off  # more salt shrinks


@fuzzed(500, bath=SALT, gamma=GAMMA)
def test_without_charge_the_gel_holds_what_the_bath_has(bath, gamma):
    assert donnan.cations(bath, 0.0, gamma) == pytest.approx(gamma * bath, rel=EPS)
    assert donnan.anions(bath, 0.0, gamma) == pytest.approx(gamma * bath, rel=2 * EPS)
    assert donnan.pressure(bath, 0.0, RT) == 0.0


@fuzzed(500, ratio=log_uniform(1e-12, 1e-3), cfc=log_uniform(1e-3, 1e3))
def test_a_dilute_bath_leaves_the_counterions(ratio, cfc):
    bath = ratio * cfc
    # c₊ = cfc (1 + r² …), c₋ = r² cfc (1 − r² …), p = Rθ cfc (1 − 2 r + 2 r² …) with r = c̄/cfc.
    relative = 3 * ratio**2 + 8 * EPS
    assert donnan.cations(bath, cfc) == pytest.approx(cfc, rel=relative)
    assert donnan.anions(bath, cfc) == pytest.approx(ratio**2 * cfc, rel=relative)
    assert donnan.pressure(bath, cfc, RT) == pytest.approx(RT * (cfc - 2 * bath), rel=relative)


MESH = rectangle(1.0, 1.0, 1, 1)
POINT = MESH(0.3, 0.4)


@fuzzed(400, bath=SALT, cfc=CHARGE, gamma=GAMMA, phi=PHI, phi_bath=PHI)
def test_floats_arrays_and_fields_agree(bath, cfc, gamma, phi, phi_bath):
    for law in (
        lambda c, q: donnan.cations(c, q, gamma),
        lambda c, q: donnan.anions(c, q, gamma),
        lambda c, q: donnan.pressure(c, q, RT, 0.3, gamma, phi, phi_bath),
    ):
        expected = law(bath, cfc)
        size = max(abs(expected), RT * (cfc + 40 * bath) + 0.3 if law(0.0 * bath + 1.0, 0.0) != law(2.0, 0.0) else 0.0)
        assert law(np.array([bath]), np.array([cfc]))[0] == pytest.approx(expected, rel=EPS, abs=EPS * size)
        assert law(CF(bath), CF(cfc))(POINT) == pytest.approx(expected, rel=4 * EPS, abs=4 * EPS * size)


# -- homogeneous equilibria --------------------------------------------------------------------------------------------


def balance(material: Material, bath: float, motion: str, load: float, J: Decimal) -> Decimal:
    """The docstring's equation at J: what the stress exceeds the pressure by, in 50 digits."""
    m = {name: Decimal(getattr(material, name)) for name in ("mu", "lam", "nS0", "cfc0", "phi", "phi_bath", "Gamma", "RT")}
    c, one = Decimal(bath), Decimal(1)
    cfc = (one - m["nS0"]) * m["cfc0"] / (J - m["nS0"])
    pressure = 2 * m["RT"] * (m["phi"] * ((m["Gamma"] * c) ** 2 + cfc * cfc / 4).sqrt() - m["phi_bath"] * c)
    extra = m["mu"] * (J ** (Decimal(2) / FREE_DIRECTIONS[motion]) - 1)
    extra += m["lam"] * (one - m["nS0"]) ** 2 * (J / (one - m["nS0"]) - J / (J - m["nS0"]))
    return extra - J * (pressure - Decimal(load))


@fuzzed(
    1500,
    material=MATERIALS,
    bath=SALT,
    motion=st.sampled_from(sorted(FREE_DIRECTIONS)),
    load=st.one_of(st.just(0.0), log_uniform(1e-6, 1e3), log_uniform(1e-6, 1e3).map(lambda value: -value)),
)
def test_a_body_at_rest_balances_or_is_refused(material, bath, motion, load):
    state, message = attempt(lambda: homogeneous_equilibrium(material, bath, motion, load=load))
    if state is None:
        assert "no equilibrium" in message
        return
    assert material.nS0 < state.J
    assert 0 < state.nS < 1
    assert state.c > 0
    assert state.c >= state.cfc * (1 - 4 * EPS)
    assert np.isfinite([state.J, state.cfc, state.nS, state.c, state.p]).all()
    # The balance changes sign across the result. Its own round-off, that of its largest terms (the bath's pressure, µ), may
    # shift the zero further than that of J.
    with localcontext() as context:
        context.prec = 50
        J, nS0 = Decimal(state.J), Decimal(material.nS0)
        if material.cfc0 > 0:  # the content is better known than J
            J = nS0 + (1 - nS0) * Decimal(material.cfc0) / Decimal(state.cfc)
        content = J - nS0
        here = balance(material, bath, motion, load, J)
        terms = material.mu * (1 + state.J ** (2 / FREE_DIRECTIONS[motion])) + material.lam * state.J
        terms += state.J * (2 * material.RT * 100 * bath + abs(state.p) + abs(load))
        terms += material.lam * (1 - material.nS0) * state.J / float(content)
        rounding = Decimal(16 * EPS * terms)
        shift = content * Decimal(16 * EPS) + (J * Decimal(2 * EPS) if material.cfc0 == 0 else 0)
        if shift >= content:
            return
        below = balance(material, bath, motion, load, nS0 + content - shift)
        above = balance(material, bath, motion, load, nS0 + content + shift)
    assert below <= rounding, (below, here, above)
    assert above >= -rounding, (below, here, above)


@fuzzed(500, material=MATERIALS, bath=SALT, motion=st.sampled_from(sorted(FREE_DIRECTIONS)), factor=st.floats(1.01, 30.0))
def test_salt_and_load_shrink_a_body(material, bath, motion, factor):
    ideal = replace(material, phi=1.0, phi_bath=1.0, Gamma=1.0)
    state, none = attempt(lambda: homogeneous_equilibrium(ideal, bath, motion))
    denser, none_denser = attempt(lambda: homogeneous_equilibrium(ideal, min(10.0, factor * bath), motion))
    loaded, none_loaded = attempt(lambda: homogeneous_equilibrium(ideal, bath, motion, load=factor * 1e-3))
    if none or none_denser or none_loaded:
        assert "no equilibrium" in none + none_denser + none_loaded
        return
    # Round-off of 2 Rθ c̄ over the stiffness of the drained body.
    slack = 1e-12 + 1e3 * EPS * (bath * factor * material.RT + 1) / (material.mu + material.lam)
    assert state.J * (1 + slack) >= denser.J
    assert state.J * (1 + slack) >= loaded.J


# -- constitutive laws -------------------------------------------------------------------------------------------------

ENTRIES = st.lists(st.floats(-0.4, 0.4), min_size=4, max_size=4)


def values(*fields) -> np.ndarray:
    return np.concatenate([np.atleast_1d(np.array(field(POINT))) for field in fields])


@fuzzed(120, material=MATERIALS, entries=ENTRIES, stretch=log_uniform(1.0, 30.0))
def test_the_stress_is_the_derivative_of_the_energy(material, entries, stretch):
    F = np.eye(3)
    F[:2, :2] = (np.eye(2) + np.array(entries).reshape(2, 2)) * (stretch**0.5)
    J = np.linalg.det(F)
    if material.nS0 * (1 + 1e-6) >= J:
        return
    tau = J * values(extra_stress(CF(tuple(F.ravel()), dims=(3, 3)), material)).reshape(3, 3)
    share = (1 - material.nS0) / (J - material.nS0)
    volumetric = material.lam * J * ((1 - material.nS0) - (1 - material.nS0) * share)
    expected = material.mu * (F @ F.T - np.eye(3)) + volumetric * np.eye(3)  # (18) as printed
    size = material.mu * (1 + np.sum(F * F)) + material.lam * J * (1 + share)
    # J − nS0 loses the digits of J: the relative error of 1/(J − nS0) is that of J over the content.
    assert np.abs(tau - expected).max() <= 64 * EPS * size * (1 + J / (J - material.nS0))


def fluxes(material, nF, bath, cfc, drive, grad_bath):
    """Fluid, cations and anions by the potentials; gradients are pairs."""
    fields = (CF(material.nS0 / (1 - nF)), CF(bath), CF(cfc), CF(tuple(drive)), CF(tuple(grad_bath)))
    return [values(flux) for flux in laws.transport_by_potentials(material, *fields)]


STATES = {
    "material": MATERIALS,
    "nF": st.one_of(st.floats(0.01, 0.999), log_uniform(1e-6, 1.0 - 1e-6)),
    "bath": log_uniform(1e-9, 10.0),
    "cfc": st.one_of(st.just(0.0), log_uniform(1e-9, 100.0)),
}
GRADIENTS = st.tuples(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0))


def admissible(material, nF) -> bool:
    """Laws of J take nS0/(1 − nF) for it: beyond a stretch of thousands, exp overflows in Holmes and Mow's."""
    return material.nS0 / (1 - nF) < 20


@fuzzed(300, **STATES, drive=GRADIENTS, of_salt=GRADIENTS)
def test_fluxes_carry_no_current_and_dissipate(material, nF, bath, cfc, drive, of_salt):
    if not admissible(material, nF):
        return
    grad_bath = bath * np.array(of_salt)
    fluid, plus, minus = fluxes(material, nF, bath, cfc, drive, grad_bath)
    assert np.isfinite([fluid, plus, minus]).all()
    # Each flux is a difference of what convection and diffusion carry.
    c_plus, c_minus = donnan.cations(bath, cfc, material.Gamma), donnan.anions(bath, cfc, material.Gamma)
    D = max(values(*(CF(d) for d in laws.diffusivities(CF(nF), material))))
    K = float(values(CF(laws.permeability(CF(material.nS0 / (1 - nF)), material)))[0])
    force = np.abs(drive).max() + 2 * material.RT * (material.phi_bath + 2) * (np.abs(grad_bath).max() + bath) + c_minus
    size = c_plus * (np.abs(fluid).max() + K * force) + nF * D * c_plus * 20
    assert np.abs(plus - minus).max() <= 1e3 * EPS * size
    # Entropy production −[nF wF · grad P' + nF c w · 2 Rθ grad ln c̃] with P' = P − 2 φ̄ Rθ c̃ is not negative.
    of_fluid = np.array(drive) - 2 * material.phi_bath * material.RT * grad_bath
    parts = [-(fluid * of_fluid), -(minus * 2 * material.RT * np.array(of_salt))]
    assert np.sum(parts) >= -1e3 * EPS * (np.abs(parts).sum() + size * material.RT * 20 + K * force**2)


@fuzzed(150, **STATES)
def test_nothing_flows_without_gradients(material, nF, bath, cfc):
    if admissible(material, nF):
        assert not np.any(fluxes(material, nF, bath, cfc, (0.0, 0.0), (0.0, 0.0)))


@fuzzed(300, **STATES, of_P=GRADIENTS, of_salt=GRADIENTS, of_cfc=GRADIENTS)
def test_both_forms_of_the_fluxes_agree_and_rest_in_equilibrium(material, nF, bath, cfc, of_P, of_salt, of_cfc):
    """The same state in (P, c̃) and in (p, c, cfc): for φ = 1, whose fluxes both forms share, and for any Γ."""
    if not admissible(material, nF):
        return
    m = replace(material, phi=1.0)
    c_plus, c_minus = donnan.cations(bath, cfc, m.Gamma), donnan.anions(bath, cfc, m.Gamma)
    D = max(values(*(CF(d) for d in laws.diffusivities(CF(nF), m))))
    K = float(values(CF(laws.permeability(CF(m.nS0 / (1 - nF)), m)))[0])

    # Θ is a sum, the currents that it divides are not: D₋ = 1000 D₊ loses three digits of c − cfc and of grad c − grad cfc.
    conductance = m.D_plus * c_plus + m.D_minus * c_minus + cfc**2 * K * m.RT / nF
    condition = 1 + max(m.D_plus, m.D_minus) * c_plus / conductance

    def disagreement(grad_P, grad_bath, grad_cfc) -> float:
        """Largest difference of the fluxes, in round-offs of what each is a sum of."""
        grad_root = 2 * (m.Gamma**2 * bath * grad_bath + cfc * grad_cfc / 4) / (c_plus + c_minus)
        grad_p = grad_P + 2 * m.RT * (grad_root - m.phi_bath * grad_bath)
        grad_c = grad_root + grad_cfc / 2
        gradients = (CF(tuple(gradient)) for gradient in (grad_p, grad_c, grad_cfc))
        fields = (CF(m.nS0 / (1 - nF)), CF(c_plus), CF(cfc), *gradients)
        by_ions = [values(flux) for flux in laws.transport(m, *fields)]
        by_potentials = fluxes(m, nF, bath, cfc, grad_P, grad_bath)
        # In (p, c, cfc) the gradients of p and of π cancel.
        force = np.abs(grad_P).max() + 2 * m.RT * (np.abs([grad_c, grad_cfc]).max() + m.phi_bath * np.abs(grad_bath).max())
        salt = c_plus * K * force + nF * D * force / m.RT
        pairs = zip(by_ions, by_potentials, (K * force, salt, salt), strict=True)
        return max(float(np.abs(a - b).max()) / (EPS * size * condition) if size > 1e-250 else 0.0 for a, b, size in pairs)

    grad_cfc = np.array(of_cfc) * max(cfc, 1e-3)
    # Measured: 17 in 10 000 states.
    assert disagreement(np.array(of_P), bath * np.array(of_salt), grad_cfc) <= 64
    # Uniform P and c̃: the potentials' fluxes vanish identically, those of (p, c, cfc) to round-off.
    assert disagreement(np.zeros(2), np.zeros(2), grad_cfc) <= 64


def test_a_deformed_point_of_each_law_is_finite():
    # Control for `admissible`: at a stretch of 40 Holmes and Mow's K is beyond floats.
    assert exp(709) < float("inf")
    law = HolmesMow(1.0, 2.0)
    assert not np.isfinite(law(1.0, CF(40.0), CF(0.2))(POINT))
    assert np.isfinite(law(1.0, CF(20.0), CF(0.2))(POINT))
    assert Det(CF((1, 0, 0, 1), dims=(2, 2)))(POINT) == 1


def test_inputs_were_generated():
    # With those of test_validation.py more than 10 000.
    assert generated(__name__) >= 8_000 * min(1.0, SCALE)
