"""How ranks end together: with one message where all meet the same error, and none that waits for another for ever."""

from __future__ import annotations

import atexit
import sys
import threading
from math import inf
from time import monotonic, sleep
from traceback import format_exception
from typing import Any

PATIENCE = 30.0
"""Seconds that a rank with an error waits for the others to meet one, too. It waits no longer than it has to where another
is known to wait for it."""

LOOK = 0.5
"""Seconds between looks for ranks that have stopped."""

STOPPED, MISSED = 1, 2
"""Tags of what a rank tells that computes no further, and of the answer of one that waits for it."""

ENDED = "every rank has ended"
"""What a rank says that ends without an error."""


class Meeting:
    """Where ranks meet that compute no further, because of an error or as the program is over.

    Each counts the collective calls that it has entered. One that stops tells the others its count; one that has entered
    more waits for it in vain, and answers so, from a thread of its own: then the first ends all, with a message. Nothing of
    this costs anything while ranks compute. It has a communicator of its own, so that it meets no call of the others.
    """

    def __init__(self, comm: Any) -> None:
        from mpi4py import MPI

        self._comm, self.rank = comm.Dup(), comm.rank
        self.entered = 0
        """Collective calls that this rank has entered."""
        self._held, self._present, self._over = 0, False, False
        self._stop = threading.Event()
        self._watch = threading.Thread(target=self._answer, args=(MPI.Status(),), daemon=True)
        self._talks = MPI.Query_thread() == MPI.THREAD_MULTIPLE
        self._sent: list[Any] = []
        self._before = sys.excepthook

    def begin(self) -> None:
        """From now on, uncaught errors and the end of the program lead here."""
        if self._talks:
            self._watch.start()
        sys.excepthook = self._uncaught
        atexit.register(self._leave)

    def settle(self, error: BaseException) -> None:
        """Called with an error in the midst of a run, before anything is done about it.

        Go on if all have met one of its kind. Else what follows would wait for ranks that do other things: end all.
        """
        met = self._meet(type(error).__name__, PATIENCE)
        if met is None or len(set(met)) > 1:
            self._end(error)

    def _meet(self, said: str, patience: float) -> list[str] | None:
        """What each rank says, once all are here; None if one waits for this rank elsewhere, or patience [s] ends."""
        self._present = True
        others = [rank for rank in range(self._comm.size) if rank != self.rank] if self._talks else []
        self._sent += [self._comm.isend((self._held, self.entered), rank, STOPPED) for rank in others]
        arrived, until = self._comm.Ibarrier(), monotonic() + patience
        while not arrived.Test():
            if self._missed() or monotonic() > until:
                return None
            sleep(0.01)
        told: list[str] = self._comm.allgather(said)
        self._held, self._present = self._held + 1, False
        return told

    def _missed(self) -> bool:
        """Whether a rank has answered that it waits for this one."""
        while self._comm.iprobe(tag=MISSED):
            if self._comm.recv(tag=MISSED) == self._held:
                return True
        return False

    def _answer(self, status: Any) -> None:
        """The thread: answers ranks that have stopped while this one has entered a call that they have not."""
        stopped: dict[int, tuple[int, int]] = {}
        while not self._stop.wait(LOOK):
            while self._comm.iprobe(tag=STOPPED, status=status):
                rank = status.Get_source()
                stopped[rank] = self._comm.recv(source=rank, tag=STOPPED)
            for rank, (meeting, entered) in list(stopped.items()):
                if meeting < self._held:
                    del stopped[rank]
                elif not self._present and self.entered > entered:
                    self._sent.append(self._comm.isend(meeting, rank, MISSED))
                    del stopped[rank]

    def _uncaught(self, kind: type[BaseException], error: BaseException, trace: Any) -> None:
        """An error that ends the program: told by the first rank if all have met it, else by each that has met another."""
        if self._over:
            self._before(kind, error, trace)
            return
        met = self._meet(f"{kind.__name__}: {error}", PATIENCE)
        if met is None:
            self._end(error)
            return
        if self.rank == 0:
            self._before(kind, error, trace)
        elif met[self.rank] != met[0]:
            self._tell(error)
        self._part()

    def _leave(self) -> None:
        """The program is over here."""
        if self._over:
            return
        if self._meet(ENDED, inf) is None:
            print(
                f"rank {self.rank} has ended, and another waits for it in a calculation: what a scene of several ranks does "
                "has to be called by all of them",
                file=sys.stderr,
                flush=True,
            )
            self._comm.Abort(1)
        self._part()

    def _part(self) -> None:
        """All have spoken: the launcher ends the others when one ends with an error."""
        sys.stderr.flush()
        self._comm.Barrier()
        self._over = True
        self._stop.set()
        if self._watch.is_alive():
            self._watch.join()

    def _tell(self, error: BaseException) -> None:
        print(f"rank {self.rank}: " + "".join(format_exception(error)), file=sys.stderr, flush=True)

    def _end(self, error: BaseException) -> None:
        """An error of this rank alone ends all."""
        self._tell(error)
        self._comm.Abort(1)


def silent_but_first(error: Exception, rank: int) -> None:
    """Let the first rank alone tell an error that all meet and cannot talk about.

    The others wait for the launcher to end them, as it would end the first one before it has spoken.
    """
    before = sys.excepthook

    def hook(kind: type[BaseException], met: BaseException, trace: Any) -> None:
        if met is error and rank > 0:
            sleep(2 * PATIENCE)
        else:
            before(kind, met, trace)

    sys.excepthook = hook
