"""Two halves of a study in two processes: their results, what they say, and their errors."""

import os
import sys
from functools import partial
from multiprocessing import active_children

import pytest
from ngsolve import SetNumThreads, ngsglobals

from studies.side_by_side import side_by_side


def told(text):
    print(text, file=sys.stderr)
    return os.getpid(), ngsglobals.numthreads


def failing():
    raise ValueError("wrong")


def test_both_are_computed_with_one_thread_and_the_other_speaks_last(capsys):
    threads = ngsglobals.numthreads
    SetNumThreads(2)
    try:
        here, there = side_by_side(partial(told, "here"), partial(told, "there"))
        assert ngsglobals.numthreads == 2
    finally:
        SetNumThreads(threads)
    assert here == (os.getpid(), 1)
    assert there[0] != here[0]
    assert there[1] == 1
    assert capsys.readouterr().err == "here\nthere\n"


@pytest.mark.parametrize("halves", [(failing, partial(told, "there")), (partial(told, "here"), failing)])
def test_an_error_of_either_ends_both(halves):
    with pytest.raises(ValueError, match="wrong"):
        side_by_side(*halves)
    assert not active_children()
