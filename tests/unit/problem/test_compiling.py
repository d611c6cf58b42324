"""Terms compiled to C++: the same numbers, objects found again, and what happens without a compiler."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from ngswell import CompilerWarning, InputError, Potential
from ngswell.problem import cached_compiler
from ngswell.problem.compiling import folder, why_not
from tests.scenes import deformed, quarter

WITH_COMPILER = pytest.mark.skipif(why_not() is not None, reason="no C++ compiler")


def system(scene):
    """The residual of a deformed state, and what the tangent makes of a vector."""
    problem = scene.problem
    deformed(problem)
    problem.begin_step(1.0, 0.7)
    residual, moved = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    problem.residual(residual)
    direction = problem.fields.vec.CreateVector()
    direction.FV().NumPy()[:] = np.random.default_rng(1).standard_normal(direction.size) * problem.sizes
    moved.data = problem.linearise() * direction
    return residual.FV().NumPy().copy(), moved.FV().NumPy().copy()


@pytest.fixture
def scene():
    return quarter(cells=1, model=Potential())


@WITH_COMPILER
def test_compiled_terms_have_the_same_values_and_objects_are_found_again(scene, tmp_path, monkeypatch):
    monkeypatch.setenv("NGSWELL_CACHE", str(tmp_path / "cache"))
    expected, found = system(scene), system(replace(scene, compiled=True))
    for one, other in zip(found, expected, strict=True):  # the order of sums is another
        assert one == pytest.approx(other, abs=1e-13 * np.abs(other).max())
    objects = {path.name: path.stat().st_mtime_ns for path in folder().glob("*.o")}
    assert len(objects) == 2  # residual and tangent
    again = system(replace(scene, compiled=True))
    assert {path.name for path in folder().glob("*.o")} == set(objects)
    for one, other in zip(again, found, strict=True):
        assert np.array_equal(one, other)
    assert "terms: compiled to C++" in replace(scene, compiled=True).describe()
    assert "terms:" not in scene.describe()


def test_without_a_compiler_terms_stay_bytecode_and_it_is_said(scene, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("sysconfig.get_path", lambda kind: str(tmp_path))
    expected = system(scene)
    with pytest.warns(CompilerWarning, match="no program ngscxx is found; install a C"):
        found = system(replace(scene, compiled=True))
    for one, other in zip(found, expected, strict=True):
        assert np.array_equal(one, other)
    assert "terms: bytecode (no program ngscxx is found" in replace(scene, compiled=True).describe()


def test_compiled_is_a_flag():
    with pytest.raises(InputError, match="compiled"):
        quarter(compiled="yes")


SOURCE = """#include <cmath>
extern void * compiled_code_pointer{};
extern void * compiled_code_pointer{};
double f() {{ return {}; }}
"""


def call(tmp_path, number, value, status=0):
    """Exit status for a source whose addresses count from `number`; the compiler copies it, or fails with `status`."""
    compiler = tmp_path / "compiler"
    compiler.write_text(f'#!/bin/sh\n[ {status} = 0 ] && cp "$2" "$4"\nexit {status}\n')
    compiler.chmod(0o755)
    source = tmp_path / "code.cpp"
    source.write_text(SOURCE.format(number, number + 1, value))
    target = tmp_path / "code.o"
    target.unlink(missing_ok=True)
    arguments = [str(tmp_path / "cache"), "6.2", str(compiler), "-c", str(source), "-o", str(target)]
    program = [sys.executable, "-I", "-S", cached_compiler.__file__, *arguments]
    ended = subprocess.run(program, check=False).returncode
    return ended, target.read_text() if target.exists() else None


def test_objects_go_by_their_source_whatever_addresses_are_called(tmp_path):
    first = call(tmp_path, 3, 1.0)
    assert first == (0, SOURCE.format(0, 1, 1.0))
    assert len(list((tmp_path / "cache").iterdir())) == 1
    assert call(tmp_path, 17, 1.0) == first
    assert len(list((tmp_path / "cache").iterdir())) == 1
    call(tmp_path, 3, 2.0)  # another source
    call(tmp_path, 3, 1.0, status=1)  # another compiler, which fails
    assert len(list((tmp_path / "cache").iterdir())) == 2
    assert call(tmp_path, 3, 1.0, status=1) == (1, None)


def test_a_folder_that_cannot_be_written_keeps_nothing(tmp_path):
    (tmp_path / "cache").write_text("a file")
    assert call(tmp_path, 3, 1.0)[0] == 0


def test_the_oldest_objects_go(tmp_path, monkeypatch):
    monkeypatch.setattr(cached_compiler, "MOST", 2)
    source = tmp_path / "object"
    source.write_text("x")
    for number in range(4):
        cached_compiler.keep(str(source), str(tmp_path / "cache" / f"{number}.o"))
    assert len(list((tmp_path / "cache").iterdir())) == 2
