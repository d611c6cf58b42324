"""Files that are there as a whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ngswell.errors import OutputError


@contextmanager
def replacing(path: Path, what: str) -> Iterator[Path]:
    """A name beside `path` to write to; what was written takes the place of `path` once it is complete and on the disk.

    Raises OutputError, with the file of before as it was, where that fails. A process that is killed here leaves a file
    ".NAME.new" at most, which the next one to write replaces.
    """
    new = path.with_name(f".{path.stem}.new{path.suffix}")
    try:
        yield new
        _to_disk(new, os.O_RDWR)
        os.replace(new, path)
        _to_disk(path.parent, os.O_RDONLY)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(
            f"{what}: {path} could not be written ({error.strerror or error}); what stood there before is unchanged. "
            "Free space on its disk, or write to another one"
        ) from error
    finally:
        new.unlink(missing_ok=True)


def _to_disk(path: Path, flags: int) -> None:
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
