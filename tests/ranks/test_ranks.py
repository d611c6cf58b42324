"""Ranks compute what one computes: every motion, model and treatment."""

import pickle

import numpy as np
import pytest

from tests.ranks.scenes import SCENES
from tests.ranks.worker import outcome

SOME = ["strip, Nitsche", "cylinder, platen", "cube, concentration, order 3"]
"""Those that are computed by four ranks, too."""


@pytest.mark.parametrize(("ranks", "names"), [(2, list(SCENES)), (4, SOME)], ids=["two", "four"])
def test_ranks_compute_what_one_does(ranks, names, together, tmp_path):
    ended = together(ranks, "-m", "tests.ranks.worker", str(tmp_path / "out"), *names)
    assert ended.returncode == 0, ended.stderr
    there = pickle.loads((tmp_path / "out").read_bytes())
    for name in names:
        here = outcome(name)
        assert [time for time, _ in there[name]["steps"]] == pytest.approx([time for time, _ in here["steps"]], rel=1e-9), (
            name
        )
        # What differs is the order of sums, round-off of 1e-16 of the largest terms, and the pivots that follow from it.
        np.testing.assert_allclose(there[name]["values"], here["values"], rtol=0, atol=1e-10, err_msg=name)
        np.testing.assert_allclose(there[name]["fluid"], here["fluid"], rtol=0, atol=1e-12, err_msg=name)
        # A correction at its tolerance may fall on either side of it.
        iterations = [sum(count for _, count in one["steps"]) for one in (there[name], here)]
        assert abs(iterations[0] - iterations[1]) <= 1, name


def test_more_ranks_than_cells_are_refused(together):
    said = together(3, "-c", "from tests.scenes import quarter; quarter(cells=1, ranks=True)")
    assert said.returncode == 1
    assert "ranks: 3 ranks for 1 cells" in said.stderr


def test_a_column_is_refused(together):
    said = together(2, "-c", "from tests.scenes import confined_column; confined_column(ranks=True)")
    assert said.returncode == 1
    assert "a column in 1-d" in said.stderr
