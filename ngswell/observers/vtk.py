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

RECORD = r"_step(\d{5,})"
"""What the names of a series' records add to it, but for the first."""

PIECE = r"_piece\d+"
"""What those of a rank's cells add to that."""


class VTK(Observer):
    """Writes `path`.pvd and one .vtu file a record, on the reference configuration (warp by "displacement").

    All the model's quantities by default, or those named; fluxes and stresses, made of derivatives, mislead at baths, held
    sides and corners (docs/limits.md); a corner where J − nS0 is not positive gets an ExtrapolationWarning, once a run.
    Vectors have three components and stresses nine, as VTK readers
    expect. `subdivision` splits each element edge 2^n times, so that quadratic displacements show. Existing series are
    kept unless `overwrite`; then the old series is removed as a whole, and no other file. One run writes a series at a
    time. Raises OutputError before any computing, and InputError on a 1-d mesh. At every moment the .pvd names complete
    pieces only; a resumed run removes those beyond its checkpoint.

    Of several ranks each writes its cells, to a disk that they have to share, and the first a .pvtu file that names them.
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
        if re.search(rf"({RECORD}|{PIECE})$", self.path.name):
            raise InputError(f"VTK: {self.path.name!r} is what a piece of another series is called; choose another name")
        super().__init__(when, str(path), *quantities)
        self._alone = ExitStack()
        self._ranks: list[int] = []  # that have written each record
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
        problem.team.of_first(lambda: check_folder(self.path.parent, "VTK"))
        self._alone.enter_context(alone(self._series, "VTK", self._names.pattern, problem.team))
        self._corners, self._warned = corners(problem.mesh), False
        self._fields = {name: _three_dimensional(outputs[name]) for name in names}

    def start(self, problem: Problem, begin: float, until: float) -> None:
        with self._let_go_on_errors():
            self.prepare(problem, begin, until)
            del self._recorded[:], self._ranks[:]
            self.team.of_first(self._make_room)
            self._record_if_due(problem, begin)

    def _make_room(self) -> None:
        """Remove an old series; a link stays, and leads to what is written next."""
        old = [file for file in [self._series, *self._files(0)] if file.exists()]
        if old and not self.overwrite:
            raise OutputError(f"VTK: {self._series} exists; choose another name or pass overwrite=True")
        for file in old:
            file.resolve().unlink()

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
        return {"ranks": np.array(self._ranks, dtype=int)}  # the pieces are on the disk

    def restore(self, state: Tree) -> None:
        self._ranks = state["ranks"].tolist() if "ranks" in state else [1] * len(self._recorded)
        self.team.of_first(self._go_on)

    def _go_on(self) -> None:
        for number in range(len(self._recorded)):
            for file in [self._record(number), *self._pieces(number)]:
                if not file.is_file():
                    raise InputError(f"VTK: {file}, written before the checkpoint, is missing; put it back")
        self._write_series()
        for file in self._files(len(self._recorded)):
            file.unlink()

    @property
    def _series(self) -> Path:
        return self.path.with_name(self.path.name + ".pvd")

    @property
    def _names(self) -> re.Pattern[str]:
        """What the series' files are called."""
        return re.compile(rf"{re.escape(self.path.name)}({RECORD})?({PIECE})?\.(vtu|pvtu|pvd)")

    def _files(self, first: int) -> list[Path]:
        """Those there are of the records from number `first` on."""
        found = [(file, self._names.fullmatch(file.name)) for file in self.path.parent.iterdir()]
        return [file for file, name in found if name and name[4] != "pvd" and int(name[2] or 0) >= first]

    def _named(self, number: int, ending: str) -> Path:
        return self.path.with_name(self.path.name + (f"_step{number:05d}" if number else "") + ending)

    def _record(self, number: int) -> Path:
        """The file of a record that the .pvd names."""
        return self._named(number, ".vtu" if self._ranks[number] == 1 else ".pvtu")

    def _pieces(self, number: int) -> list[Path]:
        """Those of the ranks, where several have written."""
        ranks = self._ranks[number]
        return [] if ranks == 1 else [self._named(number, f"_piece{rank}.vtu") for rank in range(ranks)]

    def record(self, problem: Problem, time: float) -> None:
        self._look_at_corners(problem)
        self._ranks.append(problem.team.size)
        problem.team.of_each(lambda: self._write_cells(problem))
        problem.team.of_first(self._name_pieces)

    def _write_cells(self, problem: Problem) -> None:
        """The last record's file, or this rank's piece of it."""
        number, team = len(self._recorded) - 1, problem.team
        with replacing(self._record(number) if team.alone else self._pieces(number)[team.rank], "VTK") as new:
            fields, name = self._fields, str(new.with_suffix(""))
            # A writer of its own for each piece: NGSolve's own numbering starts anew in a resumed run.
            writer = VTKOutput(problem.mesh, list(fields.values()), list(fields), name, subdivision=self.subdivision)
            writer.Do(drawelems=problem.share.cells)
            if not _complete(new):  # NGSolve does not say when the disk is full
                raise OSError("it is cut short; is the disk full?")

    def _name_pieces(self) -> None:
        """Write what names the last record, and its pieces if it has some."""
        number = len(self._recorded) - 1
        pieces = self._pieces(number)
        for piece in pieces:
            if not piece.is_file():
                raise OutputError(f"VTK: {piece} of another rank is not there for the first; write to a disk that all share")
        if pieces:
            with replacing(self._record(number), "VTK") as new:
                new.write_text(_together(pieces), encoding="utf-8")
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
            f'<DataSet timestep="{time!r}" file={quoteattr(self._record(number).name)}/>'
            for number, time in enumerate(self._recorded)
        ]
        lines = ['<?xml version="1.0"?>', '<VTKFile type="Collection" version="1.0">', "<Collection>", *entries]
        with replacing(self._series, "VTK") as new:
            new.write_text("\n".join([*lines, "</Collection>", "</VTKFile>", ""]), encoding="utf-8")


def _together(pieces: Sequence[Path]) -> str:
    """The text of a .pvtu file: the arrays of its pieces, as the first of them declares them, and their names."""
    from xml.sax.saxutils import quoteattr

    with open(pieces[0], "rb") as file:
        head = file.read(1 << 16).partition(b"<AppendedData")[0].decode()
    declared = re.findall(r'<DataArray (type="\w+" Name="[^"]*" NumberOfComponents="\d+")', head)
    points, *fields = [f"<PDataArray {array}/>" for array in declared]
    lines = ['<?xml version="1.0"?>', '<VTKFile type="PUnstructuredGrid" version="1.0" byte_order="LittleEndian">']
    lines += ['<PUnstructuredGrid GhostLevel="0">', "<PPoints>", points, "</PPoints>"]
    lines += ["<PPointData>", *fields, "</PPointData>"]
    lines += [f"<Piece Source={quoteattr(piece.name)}/>" for piece in pieces]
    return "\n".join([*lines, "</PUnstructuredGrid>", "</VTKFile>", ""])


def _complete(piece: Path) -> bool:
    with open(piece, "rb") as file:
        file.seek(max(0, piece.stat().st_size - 40))
        return b"</VTKFile>" in file.read()


def _three_dimensional(field: CoefficientFunction) -> CoefficientFunction:
    """Vectors along the motion with the zeros that they have across it; tensors are 3 × 3 as they are."""
    if len(field.dims) != 1:
        return field
    return CF(tuple(field[i] for i in range(field.dims[0])) + (0.0,) * (3 - field.dims[0]))
