"""What the fuzzed tests share: how many inputs, arguments that cannot be meant, what a sound piece is.

Inputs are the same in every run. HYPOTHESIS_PROFILE=fresh draws new ones, FUZZ_SCALE=5 five times as many.
"""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from dataclasses import fields, is_dataclass
from decimal import Decimal
from fractions import Fraction
from functools import wraps
from math import inf, isfinite, log, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from hypothesis.configuration import set_hypothesis_home_dir
from ngsolve import CF, CoefficientFunction, Mesh, x

from ngswell import Adaptive, Bath, Material, OutputError, Penalty, PowerLaw, Ramp
from ngswell.errors import InputError

SCALE = float(os.environ.get("FUZZ_SCALE", "1"))
FRESH = os.environ.get("HYPOTHESIS_PROFILE") == "fresh"

set_hypothesis_home_dir(Path(tempfile.gettempdir()) / "hypothesis")  # nothing is left in the repository

INPUTS: Counter[tuple[str, str]] = Counter()
WANTED: dict[tuple[str, str], int] = {}
"""Inputs that each test (module, name) has generated, and is to generate."""


def fuzzed(inputs: int, shrink: bool = True, **strategies):
    """A test of that many generated inputs, counted; no files, no deadline."""
    phases = [Phase.explicit, Phase.generate, *([Phase.shrink] if shrink else [])]
    chosen = settings(
        max_examples=max(1, round(inputs * SCALE)),
        derandomize=not FRESH,
        database=None,
        deadline=None,
        phases=phases,
        suppress_health_check=list(HealthCheck),
        print_blob=True,
    )

    def decorate(test):
        key = test.__module__, test.__name__
        WANTED[key] = chosen.max_examples

        @wraps(test)
        def counted(*arguments, **named):
            INPUTS[key] += 1
            return test(*arguments, **named)

        return chosen(given(**strategies)(counted))

    return decorate


def generated(module: str) -> int:
    """How many inputs the tests of a module have generated; skips where some of them did not run."""
    wanted = {key for key in WANTED if key[0] == module}
    if not wanted <= set(INPUTS):
        pytest.skip("only some of the tests ran")
    total = sum(INPUTS[key] for key in wanted)
    print(f"{total} generated inputs:", {name: INPUTS[module, name] for _, name in sorted(wanted)})
    return total


def log_uniform(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers of every order of magnitude, the ends included."""
    inside = st.floats(log(low), log(high)).map(lambda exponent: float(np.clip(np.exp(exponent), low, high)))
    return st.one_of(inside, inside, inside, st.sampled_from([low, high]))


NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from(
        [0.0, -0.0, nan, inf, -inf, 5e-324, -1e-300, 1e308, 1e15, np.float32(0.3), np.float64(nan), np.float16(2)]
    ),
    st.sampled_from([10**400, -(10**5000), 2**70, -1, 0, np.int64(3), np.longdouble(0.5)]),
)
"""Numbers of every kind, most of them beyond any range."""

JUNK = st.one_of(
    NUMBERS,
    st.none(),
    st.booleans(),
    st.text(max_size=5),
    st.complex_numbers(),
    st.sampled_from([Fraction(1, 3), Decimal("0.3"), b"top", object(), {}, {"x": 1.0}, (), [], [[1.0]], {1.0}, (1.0, "a")]),
    st.sampled_from([np.array(0.3), np.array([]), np.array([0.1, nan]), np.array(["a"]), np.eye(2), np.bool_(True)]),
    st.sampled_from([CF(0.3), CF((1.0, 2.0)), CF(1j), CF(nan), x]),
    st.sampled_from(
        [Material, PowerLaw, Bath, Ramp, len, Ramp((0.0, 0.3)), Penalty(1.0), Adaptive(), range(3), ..., slice(1)]
    ),
)
"""Whatever may be handed over in place of an argument."""


def attempt(make):
    """What `make` gives and an empty message, or None and that of the documented exception."""
    try:
        return make(), ""
    except (InputError, OutputError) as refusal:
        return None, str(refusal)


def built(make):
    """What `make` gives, checked for soundness; None if it is refused with a message of a readable length."""
    thing, message = attempt(make)
    assert not message or 10 < len(message) < 500, message
    unsound = fault(thing)
    assert not unsound, f"{thing!r}: {unsound}"
    return thing


def named(message: str, value: object) -> bool:
    """Whether a message tells a value, in one of the usual forms."""
    forms = [repr(value), str(value)]
    if isinstance(value, (int, float, np.number)):
        forms += [f"{float(value):{form}}" for form in ("g", ".6g", ".17g")]
    return any(form in message for form in forms)


def fault(thing: object) -> str:
    """What is unsound in a piece: numbers that are not finite, values that do not print; empty if nothing is."""
    if isinstance(thing, CoefficientFunction):
        return "a field that is no real number" if thing.is_complex or thing.dim != 1 else ""
    if isinstance(thing, (float, np.floating)):
        return "" if isfinite(thing) else f"{thing} is not finite"
    if isinstance(thing, (tuple, list)):
        return next(filter(None, map(fault, thing)), "")
    if is_dataclass(thing) and not isinstance(thing, (type, Mesh)):
        repr(thing), str(thing)
        inner = {field.name: getattr(thing, field.name) for field in fields(thing)}
        if isinstance(thing, Adaptive) and thing.largest == inf:  # no limit
            del inner["largest"]
        return next((f"{name}: {found}" for name, value in inner.items() if (found := fault(value))), "")
    return ""
