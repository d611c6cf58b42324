"""Two halves of a study at once, each in a process with one thread."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr
from io import StringIO
from multiprocessing import active_children, get_context
from typing import TypeVar

from ngsolve import SetNumThreads, ngsglobals

Here = TypeVar("Here")
There = TypeVar("There")


def side_by_side(here: Callable[[], Here], there: Callable[[], There]) -> tuple[Here, There]:
    """What `here` gives in this process and `there`, which can be pickled, in another.

    This one has the terminal; what the other says is printed when both are done. An error of either ends both.
    """
    threads = ngsglobals.numthreads
    SetNumThreads(1)
    try:
        with ProcessPoolExecutor(1, get_context("spawn"), _alone) as pool:
            later = pool.submit(_told, there)
            try:
                result = here()
                other, said = later.result()
            except BaseException:
                for child in active_children():
                    child.terminate()
                raise
    finally:
        SetNumThreads(threads)
    print(said, end="", file=sys.stderr, flush=True)
    return result, other


def _alone() -> None:
    """Settings of the other process; Ctrl-C reaches the first one, which ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    SetNumThreads(1)


def _told(compute: Callable[[], There]) -> tuple[There, str]:
    """What it gives and what it says."""
    with redirect_stderr(StringIO()) as said:
        return compute(), said.getvalue()
