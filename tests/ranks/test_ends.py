"""However ranks end, they end together, with one message."""

import pytest

WITHOUT = """
import sys
sys.modules["mpi4py"] = None
from tests.scenes import quarter
quarter(cells=4, ranks=True)
"""

LIMIT = 60
"""Seconds that stand for: they hang. A rank with an error waits 30 for others; none of these has to."""


@pytest.mark.parametrize(
    ("name", "says", "by"),
    [
        ("all_of_them", "IndexError: list index out of range", ""),
        ("one_that_is_caught", "MemoryError: no room", "rank 1: "),
        ("after_the_run", "KeyError: 'mine'", "rank 1: "),
        ("leaves", "rank 1 has ended, and another waits for it", ""),
    ],
)
def test_an_error_ends_all_with_one_message(name, says, by, together):
    ended = together(3, "-m", "tests.ranks.ends", name, limit=LIMIT)
    assert ended.returncode == 1
    assert ended.stderr.count(says) == 1
    assert ended.stderr.count("Traceback") == ("Error" in says)
    assert f"{by}Traceback" in ended.stderr or "Error" not in says
    assert ended.stderr.count("swelling: t = 0 s to 10 s") == (name == "after_the_run")  # of Progress
    assert ended.stderr.count("UserWarning: doubtful") == (name == "after_the_run")


def test_ranks_that_cannot_talk_to_each_other_say_so_once(together):
    ended = together(3, "-c", WITHOUT, limit=LIMIT)
    assert ended.returncode == 1
    assert ended.stderr.count("InputError: ranks: 3 ranks were started, but mpi4py does not load") == 1
