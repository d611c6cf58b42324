"""The ranks of MPI that compute one scene together: each holds the whole state, and integrates and solves its share."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from math import inf
from typing import Any, TypeVar

import numpy as np
from ngsolve import BaseVector
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.meeting import Meeting, silent_but_first

Thing = TypeVar("Thing")

LAUNCHERS = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")
"""Variables in which launchers tell how many ranks there are: those of Open MPI and of MPICH."""

RANKS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK")
"""Those that tell which of them this is."""


class Team:
    """Ranks that take the same steps. All methods are called by all of them, in the same order; alone they do nothing."""

    def __init__(self, comm: Any = None) -> None:
        self._comm = comm
        self.rank: int = 0 if comm is None else comm.rank
        self.size: int = 1 if comm is None else comm.size
        self._meeting: Meeting | None = None if self.size == 1 else Meeting(comm)
        if self._meeting is not None:
            self._meeting.begin()

    def __reduce__(self) -> tuple[Callable[[bool], Team], tuple[bool]]:
        return team_of, (not self.alone,)

    @property
    def comm(self) -> Any:
        """The communicator, taken for a collective call."""
        if self._meeting is not None:
            self._meeting.entered += 1
        return self._comm

    @property
    def alone(self) -> bool:
        """Whether there is one rank only."""
        return self.size == 1

    def sum_values(self, values: NDArray) -> None:
        """Values become their sums over all ranks, in place: the same to the bit on each."""
        self._reduce(values, "SUM")

    def _reduce(self, values: NDArray, operation: str) -> None:
        if not self.alone:
            from mpi4py import MPI

            self.comm.Allreduce(MPI.IN_PLACE, values, getattr(MPI, operation))

    def sum(self, vector: BaseVector) -> None:
        """The same of a vector."""
        self.sum_values(vector.FV().NumPy())

    def least(self, *mine: float) -> tuple[float, ...]:
        """The smallest of each number over all ranks; of numbers that are none, −∞."""
        numbers = tuple(number if number == number else -inf for number in mine)
        return numbers if self.alone else tuple(map(min, *self.comm.allgather(numbers)))

    def least_values(self, values: NDArray) -> None:
        """Values become the least of all ranks, in place."""
        self._reduce(values, "MIN")

    def most_values(self, values: NDArray) -> None:
        """The same with the greatest."""
        self._reduce(values, "MAX")

    def handed_over(self, values: NDArray, to: NDArray, of: NDArray) -> NDArray:
        """What the others have for this rank, in their order, when `values` are for them: as many as `to` and `of` say."""
        if self.alone:
            return values
        received = np.empty(int(of.sum()), values.dtype)
        self.comm.Alltoallv((values, to), (received, of))
        return received

    def joined(self, values: NDArray) -> NDArray:
        """The values of all ranks, one after the other, on each."""
        if self.alone:
            return values
        sizes = self.each(values.size)
        together = np.empty(sum(sizes), values.dtype)
        self.comm.Allgatherv(values, (together, sizes))
        return together

    def all(self, mine: bool) -> bool:
        """Whether it is so on every rank."""
        return mine if self.alone else all(self.comm.allgather(bool(mine)))

    def any(self, mine: bool) -> bool:
        """Whether it is so on some rank."""
        return mine if self.alone else any(self.comm.allgather(bool(mine)))

    def each(self, mine: Thing) -> list[Thing]:
        """What each rank has, by rank."""
        return [mine] if self.alone else self.comm.allgather(mine)

    def of_first(self, make: Callable[[], Thing]) -> Thing:
        """What the first rank makes, for all; an error that it meets is raised on all."""
        if self.alone:
            return make()
        found: tuple[Any, BaseException | None] = (None, None)
        if self.rank == 0:
            try:
                found = (make(), None)
            except Exception as error:
                found = (None, error)
        made, met = self.comm.bcast(found)
        if met is not None:
            raise met
        return made

    def of_each(self, make: Callable[[], Thing]) -> Thing:
        """What this rank makes by itself; an error that one meets is raised on all."""
        if self.alone:
            return make()
        made, met = None, None
        try:
            made = make()
        except Exception as error:
            met = error
        for one in self.each(met):
            if one is not None:
                raise one
        return made  # type: ignore[return-value]

    @contextmanager
    def settled(self) -> Iterator[None]:
        """An error leaves this only if all ranks have met one of its kind; else it ends all, with a message."""
        try:
            yield
        except BaseException as error:
            if self._meeting is not None:
                self._meeting.settle(error)
            raise

    def from_first(self, values: NDArray) -> None:
        """Values become those of the first rank, in place."""
        if not self.alone:
            self.comm.Bcast(values)

    def __repr__(self) -> str:
        return f"Team of {self.size}"


ALONE = Team()


def _launched(names: tuple[str, ...]) -> int | None:
    return next((int(os.environ[name]) for name in names if os.environ.get(name, "").isdigit()), None)


def speaks() -> bool:
    """Whether what this process has to say is said by it: by the first of the ranks that compute together."""
    return not everyone.cache_info().currsize or everyone().rank == 0


def team_of(ranks: bool) -> Team:
    """All ranks that mpirun has started, if `ranks` are to compute together; else this one alone."""
    return everyone() if ranks else ALONE


@cache
def everyone() -> Team:
    """All ranks that mpirun has started; one where it has not.

    Raises InputError where ranks cannot talk to each other: without mpi4py, or with one of another MPI than the launcher's.
    """
    size = _launched(LAUNCHERS)
    if size is None or size == 1:
        return ALONE
    try:
        from mpi4py import MPI
    except ImportError as error:
        raise _said_once(
            f"ranks: {size} ranks were started, but mpi4py does not load ({error}); pip install mpi4py, or start one rank"
        ) from None
    if MPI.COMM_WORLD.size != size:
        library = MPI.Get_library_version().partition(",")[0].strip()
        raise _said_once(
            f"ranks: the launcher started {size} ranks, but mpi4py sees {MPI.COMM_WORLD.size}: it has loaded another MPI "
            f"({library}) than the launcher's; take the mpirun (or mpiexec) of that MPI"
        )
    return Team(MPI.COMM_WORLD)


def _said_once(text: str) -> InputError:
    """An error of all ranks, which cannot talk to each other, for the first to tell."""
    error = InputError(text)
    silent_but_first(error, _launched(RANKS) or 0)
    return error
