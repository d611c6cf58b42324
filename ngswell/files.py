"""Files that are there as a whole or not at all."""

from __future__ import annotations

import json
import os
import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from glob import escape
from pathlib import Path
from typing import Any, TypeAlias
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from ngswell.checks import short
from ngswell.errors import InputError, OutputError
from ngswell.team import ALONE, Team

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

REMEDY = "what stood there before is unchanged. Free space on its disk, or write to another one"

Tree: TypeAlias = dict[str, Any]
"""Arrays by name, in as many levels as their owners like: a value is an array or another Tree."""


@contextmanager
def replacing(path: Path, what: str) -> Iterator[Path]:
    """A name beside `path` to write to; what was written takes the place of `path` once it is complete and on the disk.

    A symbolic link stays: the file it leads to is replaced. Raises OutputError, with the file of before as it was, where
    that fails. A process that is killed here leaves a file ".NAME.TOKEN.new", which `alone` clears away.
    """
    target = path.resolve()
    new = target.with_name(f".{target.stem}.{uuid4().hex[:12]}.new{target.suffix}")
    try:
        yield new
        _to_disk(new, os.O_RDWR)
        os.replace(new, target)
        _to_disk(target.parent, os.O_RDONLY)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{what}: {path} could not be written ({error.strerror or error}); {REMEDY}") from error
    finally:
        new.unlink(missing_ok=True)


@contextmanager
def alone(path: Path, what: str, names: str | None = None, team: Team = ALONE) -> Iterator[None]:
    """Nothing else writes `path` meanwhile, in no process or thread; raises OutputError if something does already.

    Of a `team` the first rank holds the lock for all.

    The lock is the system's, on a file ".NAME.lock", and ends with the process, however that ends. Where the system or the
    disk has no such locks, nothing is noticed. What a killed writer of `path` left half written, or of all files whose
    names fit the pattern `names`, is cleared away.
    """
    with ExitStack() as held:
        team.of_first(lambda: held.enter_context(_alone(path, what, names)))
        yield


@contextmanager
def _alone(path: Path, what: str, names: str | None) -> Iterator[None]:
    target = path.resolve()
    lock = target.with_name(f".{target.name}.lock")
    held = _lock(lock, path, what)
    try:
        for file in target.parent.glob(f".{escape(target.stem)}*.new*"):
            half_written = re.fullmatch(r"\.(.*)\.[0-9a-f]{12}\.new(\..*)?", file.name)
            if half_written and re.fullmatch(names or re.escape(target.name), "".join(filter(None, half_written.groups()))):
                file.unlink(missing_ok=True)
        yield
    finally:
        lock.unlink(missing_ok=True)  # while it is held: who has opened it meanwhile looks whether it is still there
        if held is not None:
            os.close(held)


def _lock(lock: Path, path: Path, what: str) -> int | None:
    """The open file that holds a lock; None where there are no locks."""
    while fcntl is not None:
        try:
            file = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise OutputError(f"{what}: {path} could not be written ({error.strerror}); {REMEDY}") from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(file), os.stat(lock)):
                return file
        except BlockingIOError:
            os.close(file)
            raise OutputError(
                f"{what}: another run or observer is writing {path}; wait until it has ended, or choose another name"
            ) from None
        except FileNotFoundError:  # unlinked by the one that had it
            pass
        except OSError:
            os.close(file)
            return None
        os.close(file)
    return None


def _to_disk(path: Path, flags: int) -> None:
    """Wait until a file, or the entry of one in a folder, is on the disk."""
    if path.is_dir() and os.name == "nt":  # Windows opens no folders; it writes their entries through
        return
    file = os.open(path, flags)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def check_folder(folder: Path, what: str) -> None:
    """Refuse a folder that is missing or cannot be written to."""
    if not folder.is_dir():
        raise OutputError(f"{what}: there is no folder {folder}; make it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{what}: the folder {folder} cannot be written to")


HEADER = "header"
"""Name of the archive's entry that holds what is not an array; the arrays are numbered."""


def write_tree(path: Path, what: str, header: Mapping[str, Any], tree: Tree) -> None:
    """A tree of arrays and a header of JSON values in one file, whole or not at all; raises OutputError.

    Raises InputError for a value that is no array of numbers or texts: it could not be read back.
    """
    entries = list(_flat(tree))
    for names, array in entries:
        if array is not None and array.dtype.hasobject:
            raise InputError(f"{what}: {'/'.join(names)} holds {short(array.tolist())}; keep arrays of numbers or texts")
    arrays = {str(number): array for number, (_, array) in enumerate(entries) if array is not None}
    text = json.dumps({**header, "entries": [[list(names), array is not None] for names, array in entries]})
    with replacing(path, what) as new, open(new, "wb") as file:
        np.savez(file, **{HEADER: np.array(text.encode()), **arrays})  # type: ignore[arg-type]


def read_tree(path: Path) -> tuple[dict[str, Any], Tree]:
    """Header and tree of a file that `write_tree` wrote. Raises what a damaged file makes zipfile, numpy and json raise."""
    with zipfile.ZipFile(path) as archive:
        damaged = archive.testzip()
    if damaged is not None:
        raise ValueError(f"checksum of {damaged}")
    tree: Tree = {}
    with np.load(path, allow_pickle=False) as archive:
        if HEADER not in archive.files:
            raise ValueError(f"nothing in it is called {HEADER}")
        header = json.loads(archive[HEADER].item())
        for number, (names, is_array) in enumerate(header.pop("entries")):
            branch = tree
            for name in names[:-1] if is_array else names:
                branch = branch.setdefault(name, {})
            if is_array:
                branch[names[-1]] = archive[str(number)]
    return header, tree


def _flat(tree: Tree, above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], NDArray | None]]:
    """Entries of a tree as (names, array); a branch without entries keeps its place, without an array."""
    if not tree and above:
        yield above, None
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _flat(value, (*above, name))
        else:
            yield (*above, name), np.asarray(value)
