"""Expressions compiled: to NGSolve's bytecode, or to C++ with objects kept between runs."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from netgen.meshing import NgException
from ngsolve import CoefficientFunction, __version__, config

from ngswell.calls import warn
from ngswell.errors import CompilerWarning
from ngswell.problem import cached_compiler

Compile = Callable[[CoefficientFunction], CoefficientFunction]


def bytecode(function: CoefficientFunction) -> CoefficientFunction:
    """Steps that NGSolve interprets, many points at once."""
    return function.Compile()


def cpp(function: CoefficientFunction) -> CoefficientFunction:
    """Machine code by a C++ compiler; bytecode, with a CompilerWarning, where there is none or it fails.

    An object is made once and found again by its source, the compiler's flags and NGSolve's version, in `folder`.
    """
    missing = why_not()
    if missing is None:
        try:
            with _in_front_of_compiler():
                return function.Compile(realcompile=True, maxderiv=0, wait=True)
        except (NgException, RuntimeError) as error:
            missing = str(error)
    warn(CompilerWarning(f"compiled=True, but terms stay bytecode: {missing}"))
    return bytecode(function)


def why_not() -> str | None:
    """Why nothing can be compiled to C++ here; None where it can."""
    for program in ("ngscxx", "ngsld", "c++"):
        if shutil.which(program, path=_path()) is None:
            return f"no program {program} is found; install a C++ compiler (Debian: g++)"
    return None


def folder() -> Path:
    """Where objects are kept: NGSWELL_CACHE, or `ngswell` in the user's folder for caches."""
    given = os.environ.get("NGSWELL_CACHE")
    return Path(given) if given else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ngswell"


def _path() -> str:
    """PATH with the programs of this Python, which it lacks where the environment is not activated."""
    return os.pathsep.join([sysconfig.get_path("scripts"), os.environ.get("PATH", "")])


@contextmanager
def _in_front_of_compiler() -> Iterator[None]:
    """Within it, NGSolve's calls of its compiler's script go through `cached_compiler`."""
    before, path = os.environ.get("PATH"), _path()
    compiler = shutil.which("ngscxx", path=path) or ""
    call = [sys.executable, "-I", "-S", cached_compiler.__file__, str(folder()), __version__, compiler]
    with tempfile.TemporaryDirectory() as front:
        _program(front, "ngscxx", call)
        if sys.platform == "linux":  # as NGSolve's, which asks a Python process for the libraries each time
            _program(front, "ngsld", ["c++", *shlex.split(config.get_link_lib_args())])
        os.environ["PATH"] = os.pathsep.join([front, path])
        try:
            yield
        finally:
            if before is None:
                del os.environ["PATH"]
            else:
                os.environ["PATH"] = before


def _program(folder: str, name: str, call: Sequence[str]) -> None:
    """A shell script that makes a `call` with its own arguments added."""
    script = Path(folder) / name
    script.write_text(f'#!/bin/sh\nexec {shlex.join(call)} "$@"\n')
    script.chmod(0o755)
