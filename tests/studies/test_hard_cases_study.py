"""The study of hard cases at its quick size, once: its numbers, and how the attempts of each family end.

One test, since every process that takes a part of it would compute all of it.
"""

from collections import Counter

import pytest

from studies.hard_cases.attempt import CHOICES
from studies.hard_cases.cells import UNSOUND
from studies.hard_cases.treatments import ALL
from tests.studies.quick import quick


def test_hard_cases(tmp_path):
    numbers, (header, *rows) = quick("hard_cases", tmp_path)
    attempts = [dict(zip(header, row, strict=True)) for row in rows]
    check_numbers(numbers)
    assert {a["outcome"] for a in attempts} == {"passes", "stops", "refused"}
    assert all(a["message"] for a in attempts if a["outcome"] != "passes")
    of = {name: [a for a in attempts if a["family"] == name] for name in {a["family"] for a in attempts}}
    for name in ("charge", "sudden_steps", "contrasts", "penalties", "cycles", "corner", "swelling", "treatments"):
        assert passed(of[name]), name
    assert {a["variant"] for a in of["corner"]} == set(CHOICES)
    assert {a["variant"].rsplit(", ", 1)[0] for a in of["treatments"]} == set(ALL)
    check_compression(of["compression"])
    check_cells(of["cells"])
    check_wrinkles(of["wrinkles"])


def passed(attempts, start=""):
    outcomes = {a["outcome"] for a in attempts if a["case"].startswith(start)}
    return outcomes == {"passes"}


def check_numbers(numbers):
    assert numbers["wrong"] == 0
    for key in (k for k in numbers if k.endswith("_error_over_bound")):
        assert numbers[key] <= 1, key
    # The consistent matrix' projection of a jump, √3 − 2; above the limit nothing alternates.
    assert numbers["alternation_lowest"] == pytest.approx(3**0.5 - 2, rel=5e-3)
    assert numbers["alternation_above_limit"] > -1e-6
    assert numbers["alternation_difference"] < 1e-5
    assert numbers["skin_graded"] < 1e-2 < 1 < numbers["skin_even"]
    for variant in ("potential", "concentration"):  # second order away from the corner, first at it
        assert numbers[f"corner_{variant}_area_order"] > 1.3
        assert 0.8 < numbers[f"corner_{variant}_arch_order"] < 1.6
    assert numbers["wrinkle_change"] < 0.03
    assert numbers["wrinkle_hidden_um"] < 0 < numbers["wrinkle_um"]


def check_compression(attempts):
    assert passed(attempts, "1 % left")
    none = [a for a in attempts if a["case"].startswith("no equilibrium")]
    assert {a["outcome"] for a in none} == {"stops"}
    assert all(a["message"].startswith(("no step succeeds", "equilibrate finds no state of rest")) for a in none)


def check_cells(attempts):
    unsound = {case: [a for a in attempts if a["case"].startswith(case)] for case in UNSOUND}
    refused = [a for found in unsound.values() for a in found]
    assert all(unsound.values())
    assert {a["outcome"] for a in refused} == {"refused"}
    assert all(a["message"].startswith("mesh: cell ") for a in refused)
    assert passed([a for a in attempts if a["case"] not in unsound])


def check_wrinkles(attempts):
    """No run ends unstable without a word: those that converge step by step to the end warn, those that are watched stop."""
    assert Counter(a["outcome"] for a in attempts) == {"passes": 6, "stops": 1}
    said = [a["message"] for a in attempts if a["message"]]
    assert len(said) == 4  # not the seed of 1e-4, whose wrinkle the steps find, nor the two that are of the converged one
    assert all("is unstable: perturbations grow" in message and "wrinkles of about" in message for message in said)
