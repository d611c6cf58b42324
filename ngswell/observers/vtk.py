"""VTK time series for ParaView and pyvista."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from ngsolve import CF, CoefficientFunction, VTKOutput, x, y, z

from ngswell import checks
from ngswell.errors import InputError, OutputError
from ngswell.files import Tree, alone, check_folder, replacing
from ngswell.mesh.points import corners
from ngswell.models.solid_state import warn_of_extrapolation
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem

PIECE = r"_step\d{5,}"
"""What the names of a series' pieces add to it, but for the first."""


class VTK(Observer):
    """Writes `path`.pvd and one .vtu file a record, on the reference configuration (warp by "displacement").

    All the model's quantities by default, or those named; fluxes and stresses, made of derivatives, mislead at baths, held
    sides and corners (docs/limits.md); a corner where J − nS0 is not positive gets an ExtrapolationWarning, once a run.
    Vectors have three components and stresses nine, as VTK readers
    expect. `subdivision` splits each element edge 2^n times, so that quadratic displacements show. Existing series are
    kept unless `overwrite`; then the old series is removed as a whole, and no other file. One run writes a series at a
    time. Raises OutputError before any computing, and InputError on a 1-d mesh. At every moment the .pvd names complete
    pieces only; a resumed run replaces those beyond its checkpoint.
    """

    def __init__(
        self,
        path: str | Path,
        *quantities: str,
        when: float | Sequence[float] | None = None,
        subdivision: int = 1,
        overwrite: bool = False,
    ) -> None:
        self.path = checks.path("VTK", path, "out/swelling")
        if re.search(rf"{PIECE}$", self.path.name):
            raise InputError(f"VTK: {self.path.name!r} is what a piece of another series is called; choose another name")
        super().__init__(when, str(path), *quantities)
        self._alone = ExitStack()
        for quantity in quantities:
            checks.name("VTK: a quantity", quantity, "displacement")
        subdivision = checks.integer("VTK: subdivision", subdivision, 0, 5)
        checks.flag("VTK: overwrite", overwrite)
        self.quantities, self.subdivision, self.overwrite = quantities, subdivision, overwrite

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        if problem.mesh.dim == 1:  # NGSolve's writer leaves coordinates and derivatives of 1-d meshes unset
            raise InputError("VTK: NGSolve writes no 1-d meshes; watch a column with Probe, or run it as a strip")
        outputs = problem.state.outputs()
        for name in self.quantities:
            problem.state.output(name)
        names = list(self.quantities or outputs)
        if "displacement" not in names:
            names.append("displacement")
        check_folder(self.path.parent, "VTK")
        self._alone.enter_context(alone(self._series, "VTK", rf"{re.escape(self.path.name)}({PIECE})?\.(vtu|pvd)"))
        self._corners, self._warned = corners(problem.mesh), False
        self._fields = {name: _three_dimensional(outputs[name]) for name in names}

    def start(self, problem: Problem, begin: float, until: float) -> None:
        with self._let_go_on_errors():
            self.prepare(problem, begin, until)
            del self._recorded[:]
            piece = re.compile(rf"{re.escape(self.path.name)}({PIECE})?\.vtu")
            pieces = [file for file in self.path.parent.iterdir() if piece.fullmatch(file.name)]
            old = [file for file in [self._series, *pieces] if file.exists()]
            if old and not self.overwrite:
                raise OutputError(f"VTK: {self._series} exists; choose another name or pass overwrite=True")
            for file in old:
                file.resolve().unlink()  # a link stays, and leads to what is written next
            self._record_if_due(problem, begin)

    def resume(self, problem: Problem, begin: float, until: float, state: Tree) -> None:
        with self._let_go_on_errors():
            super().resume(problem, begin, until, state)

    @contextmanager
    def _let_go_on_errors(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            self._alone.close()
            raise

    def finish(self, problem: Problem) -> None:
        self._alone.close()

    def state(self) -> Tree:
        return {}  # the pieces are on the disk

    def restore(self, state: Tree) -> None:
        for number in range(len(self._recorded)):
            if not self._piece(number).is_file():
                raise InputError(f"VTK: {self._piece(number)}, written before the checkpoint, is missing; put it back")
        self._write_series()

    @property
    def _series(self) -> Path:
        return self.path.with_name(self.path.name + ".pvd")

    def _piece(self, number: int) -> Path:
        return self.path.with_name(self.path.name + (f"_step{number:05d}" if number else "") + ".vtu")

    def record(self, problem: Problem, time: float) -> None:
        self._look_at_corners(problem)
        with replacing(self._piece(len(self._recorded) - 1), "VTK") as new:
            fields, name = self._fields, str(new.with_suffix(""))
            # A writer of its own for each piece: NGSolve's own numbering starts anew in a resumed run.
            writer = VTKOutput(problem.mesh, list(fields.values()), list(fields), name, subdivision=self.subdivision)
            writer.Do()
            if not _complete(new):  # NGSolve does not say when the disk is full
                raise OSError("it is cut short; is the disk full?")
        self._write_series()

    def _look_at_corners(self, problem: Problem) -> None:
        """Warn, once, where the fields overshoot."""
        if self._warned:
            return
        contents = problem.state.content(self._corners).ravel()
        worst = int(np.argmin(contents))
        if contents[worst] <= 0:
            self._warned = True
            position = CF((x, y, z)[: problem.mesh.dim])(self._corners[worst : worst + 1])
            warn_of_extrapolation("VTK", contents[worst], position.ravel())

    def _write_series(self) -> None:
        from xml.sax.saxutils import quoteattr  # not above: it imports urllib, http and ssl

        entries = [
            f'<DataSet timestep="{time!r}" file={quoteattr(self._piece(number).name)}/>'
            for number, time in enumerate(self._recorded)
        ]
        lines = ['<?xml version="1.0"?>', '<VTKFile type="Collection" version="1.0">', "<Collection>", *entries]
        with replacing(self._series, "VTK") as new:
            new.write_text("\n".join([*lines, "</Collection>", "</VTKFile>", ""]), encoding="utf-8")


def _complete(piece: Path) -> bool:
    with open(piece, "rb") as file:
        file.seek(max(0, piece.stat().st_size - 40))
        return b"</VTKFile>" in file.read()


def _three_dimensional(field: CoefficientFunction) -> CoefficientFunction:
    """Vectors along the motion with the zeros that they have across it; tensors are 3 × 3 as they are."""
    if len(field.dims) != 1:
        return field
    return CF(tuple(field[i] for i in range(field.dims[0])) + (0.0,) * (3 - field.dims[0]))
