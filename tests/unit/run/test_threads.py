"""Threads of a run: from a size on, or where the user asks for them."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from ngsolve import GetNumThreads, SetNumThreads, TaskManager, ngsglobals

from ngswell import Fixed
from ngswell.run import threads
from tests.scenes import confined_column


@pytest.fixture(autouse=True)
def _two_threads():
    before = ngsglobals.numthreads
    SetNumThreads(2)
    yield
    SetNumThreads(before)


def run(seen):
    """The end of a column's run, which notes the threads that its observers see."""
    result = confined_column().run(3.0, Fixed(1.0), [lambda time, state: seen.append(GetNumThreads())], unstable="off")
    return result.end.values


def test_small_runs_take_one_thread_and_large_ones_all(monkeypatch):
    scene, one, two = confined_column(), [], []
    alone = run(one)
    assert set(one) == {1}
    assert "\n  threads: 1 (more from 20000 unknowns on)" in scene.describe()
    monkeypatch.setattr(threads, "THREADS_FROM", scene.problem.space.ndof)
    together = run(two)
    assert set(two) == {2}
    assert "\n  threads: 2" in scene.describe()
    np.testing.assert_allclose(together, alone, rtol=1e-12, atol=1e-14)  # but for the order in which threads add
    monkeypatch.setattr(threads, "THREADS_FROM", scene.problem.space.ndof + 1)
    one.clear()
    run(one)
    assert set(one) == {1}


def test_a_task_manager_around_a_small_run_is_its_own():
    seen = []
    with TaskManager():
        run(seen)
        assert GetNumThreads() == 2
    assert set(seen) == {2}


def test_ranks_take_a_thread_each():
    many = SimpleNamespace(team=SimpleNamespace(alone=False), space=SimpleNamespace(ndof=10 * threads.THREADS_FROM))
    assert threads.threads_said(many) == "1 on each rank"
    assert isinstance(threads.threads_for(many), nullcontext)
