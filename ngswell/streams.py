"""Text files that grow by whole lines: the records of long runs."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from io import FileIO, StringIO
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError, OutputError
from ngswell.files import REMEDY, Tree, alone, check_folder
from ngswell.team import ALONE, Team

CHUNK = 1 << 20
"""Bytes that are read at once where only their checksum counts."""


class CSV:
    """A file of comma-separated values that records go to as they are made, in place of the memory.

        Probe((0.5,), "J", to=CSV("J.csv", overwrite=True))

    A path in its place means CSV(path). A header names the columns, each record is a line, numbers have all their digits. An
    existing file is refused unless `overwrite`; a run that goes on from a checkpoint goes on with it, from there. One run
    writes a file at a time. A killed run may leave its last line cut short: `read` leaves that out.
    """

    def __init__(self, path: str | Path, overwrite: bool = False) -> None:
        checks.flag("CSV: overwrite", overwrite)
        self.path, self.overwrite = checks.path("CSV", path, "J.csv"), overwrite

    @classmethod
    def of(cls, what: str, to: str | Path | CSV | None) -> CSV | None:
        """What `to` means; refuses what is neither a path nor a CSV."""
        if to is None or isinstance(to, CSV):
            return to
        return cls(checks.path(what, to, "J.csv"))

    def __repr__(self) -> str:
        return f"CSV({str(self.path)!r})"

    def write(self, what: str, columns: Mapping[str, NDArray]) -> None:
        """A whole table: columns by name, one row an entry, and of vectors and tensors one column a component, "u 1 [mm]"
        for "u [mm]". `what` names the writer. Raises OutputError for a file that exists or cannot be written."""
        header, parts = [], []
        for name, values in columns.items():
            flat = np.asarray(values, dtype=float).reshape(len(values), -1)
            stem, _, unit = name.rpartition(" [")
            header += [name] if values.ndim == 1 else [f"{stem} {number} [{unit}" for number in range(1, flat.shape[1] + 1)]
            parts.append(flat)
        stream = Stream(self, what)
        stream.begin()
        try:
            stream.write(header)
            for row in np.column_stack(parts).tolist():
                stream.write(list(map(repr, row)))
        finally:
            stream.close()

    def rows(self) -> Iterator[list[str]]:
        """All whole lines, the header first. Raises InputError for a file that is missing or no text."""
        if not self.path.is_file():
            raise InputError(f"CSV: there is no file {self.path}")
        text = self.path.read_bytes()
        try:
            yield from csv.reader(StringIO(text[: text.rfind(b"\n") + 1].decode()))
        except (UnicodeDecodeError, csv.Error) as error:
            raise InputError(f"CSV: {self.path} is damaged ({error})") from error

    def read(self) -> dict[str, NDArray]:
        """Columns of numbers by name. Raises InputError for a file that is missing, or holds anything else."""
        header, *rows = list(self.rows()) or [[]]
        try:
            table = np.array([[float(number) for number in row] for row in rows]).reshape(len(rows), len(header))
        except ValueError as error:
            raise InputError(f"CSV: {self.path} is damaged, or holds more than numbers ({error})") from error
        return dict(zip(header, table.T, strict=True))


class Stream:
    """What one run writes to a CSV file: `begin` or `resume`, then `write` by `write`, then `close`.

    `state` is what a checkpoint keeps of it, however long the file: its size and checksum. Of a team, all call, the first
    rank writes, and an error of it is one of all; others read the file where they see the first one's disk.
    """

    def __init__(self, to: CSV, what: str) -> None:
        self.to, self.what = to, what
        self._file: FileIO | None = None
        self._held = ExitStack()
        self._size = self._sum = 0
        self._team = ALONE

    def begin(self, team: Team = ALONE) -> None:
        """Start a new file; raises OutputError for one that exists or cannot be written."""
        self._team = team
        team.of_first(self._begin)

    def _begin(self) -> None:
        self._hold()
        try:
            if self.to.path.exists() and not self.to.overwrite:
                raise OutputError(f"{self.what}: {self.to.path} exists; choose another name or pass overwrite=True to CSV")
            self._open("wb")
        except BaseException:
            self.close()
            raise

    def resume(self, state: Tree, team: Team = ALONE) -> None:
        """Go on after the lines that `state` tells of, and drop those beyond. Raises InputError where they are not there."""
        self._team = team
        self._size, self._sum = map(int, state["written"].tolist())
        team.of_first(self._resume)

    def _resume(self) -> None:
        self._hold()
        try:
            if _sum_of(self.to.path, self._size) != self._sum:
                raise InputError(
                    f"{self.what}: {self.to.path} is not as it was at the checkpoint; put it back, or start anew with "
                    "overwrite=True for both"
                )
            self._open("r+b")
            assert self._file is not None
            self._file.truncate(self._size)
            self._file.seek(self._size)
        except BaseException:
            self.close()
            raise

    def _hold(self) -> None:
        """Refuse what cannot be written, and another writer."""
        check_folder(self.to.path.resolve().parent, self.what)
        if self.to.path.is_dir():
            raise OutputError(f"{self.what}: {self.to.path} is a folder; choose another name")
        self._held.enter_context(alone(self.to.path, self.what))

    def _open(self, mode: str) -> None:
        try:
            self._file = FileIO(self.to.path, mode)
        except OSError as error:
            raise self._failed(error.strerror) from error

    def _failed(self, why: str | None) -> OutputError:
        return OutputError(f"{self.what}: {self.to.path} could not be written ({why}); {REMEDY}")

    def write(self, entries: Sequence[object]) -> None:
        """One line, whole or not at all as long as the process lives; raises OutputError."""
        self._size, self._sum = self._team.of_first(lambda: self._written(entries))

    def _written(self, entries: Sequence[object]) -> tuple[int, int]:
        """Size and checksum of the file with one line more."""
        assert self._file is not None
        text = StringIO()
        csv.writer(text, lineterminator="\n").writerow(entries)
        line = text.getvalue().encode()
        try:
            whole, why = self._file.write(line) == len(line), "it is cut short; is the disk full?"
        except OSError as error:
            whole, why = False, error.strerror or str(error)
        if not whole:
            self._file.truncate(self._size)
            self._file.seek(self._size)
            raise self._failed(why)
        return self._size + len(line), crc32(line, self._sum)

    def state(self) -> Tree:
        """Size [bytes] and checksum of what was written, once it is on the disk."""
        self._team.of_first(self._to_disk)
        return {"written": np.array([self._size, self._sum])}

    def _to_disk(self) -> None:
        if self._file is not None:
            os.fsync(self._file.fileno())

    def there(self) -> CSV:
        """The file, to be read. Raises InputError on a rank that does not see what the first one has written."""
        if self._team.rank > 0 and _sum_of(self.to.path, self._size) != self._sum:
            raise InputError(
                f"{self.what}: rank {self._team.rank} does not find in {self.to.path} what the first rank has written; ask "
                "for it on the first rank alone, or write to a disk that all ranks share"
            )
        return self.to

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
        self._file = None
        self._held.close()


def _sum_of(path: Path, size: int) -> int | None:
    """Checksum of the first `size` bytes of a file; None if it has fewer."""
    if not path.is_file():
        return None
    total = 0
    with open(path, "rb") as file:
        while size > 0:
            chunk = file.read(min(CHUNK, size))
            if not chunk:
                return None
            size -= len(chunk)
            total = crc32(chunk, total)
    return total
