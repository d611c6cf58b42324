"""Ranks compute what one computes: every motion, model and treatment."""

import pickle

import numpy as np
import pytest

from tests.ranks.scenes import SCENES
from tests.ranks.tasks import TASKS, outcome

SOME = ["strip, Nitsche", "cylinder, platen", "cube, concentration, order 3", "observers"]
"""What four ranks compute, too."""


@pytest.mark.parametrize(("ranks", "names"), [(2, [*SCENES, *TASKS]), (4, SOME)], ids=["two", "four"])
def test_ranks_compute_what_one_does(ranks, names, together, tmp_path):
    ended = together(ranks, "-m", "tests.ranks.worker", str(tmp_path / "out"), *names)
    assert ended.returncode == 0, ended.stderr
    there = pickle.loads((tmp_path / "out").read_bytes())
    for name in names:
        here = outcome(name)
        assert there[name].keys() == here.keys(), name
        for what, value in here.items():
            found, where = there[name][what], f"{name}: {what}"
            if isinstance(value, str):
                assert found == value, where
            elif isinstance(value, int):  # iterations: a correction at its tolerance may fall on either side of it
                assert abs(found - value) <= 1, where
            else:
                # What differs is the order of sums, round-off of 1e-16 of the largest terms, and the pivots that follow.
                scale = max(1.0, float(np.abs(value[np.isfinite(value)]).max(initial=0.0)))
                np.testing.assert_allclose(found, value, rtol=0, atol=1e-10 * scale, err_msg=where)


def test_more_ranks_than_cells_are_refused(together):
    said = together(3, "-c", "from tests.scenes import quarter; quarter(cells=1, ranks=True)")
    assert said.returncode == 1
    assert said.stderr.count("InputError: ranks: 3 ranks for 1 cells") == 1


def test_a_column_is_refused(together):
    said = together(2, "-c", "from tests.scenes import confined_column; confined_column(ranks=True)")
    assert said.returncode == 1
    assert said.stderr.count("InputError: ranks: 2 ranks for a column in 1-d") == 1
