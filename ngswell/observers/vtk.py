"""VTK time series for ParaView and pyvista."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ngsolve import CF, CoefficientFunction, VTKOutput

from ngswell import checks
from ngswell.errors import InputError, OutputError
from ngswell.observers.base import Observer
from ngswell.problem import Problem


class VTK(Observer):
    """Writes `path`.pvd and one .vtu file a record, on the reference configuration (warp by "displacement").

    All the model's quantities by default, or those named. Vectors have three components and stresses nine, as VTK readers
    expect. `subdivision` splits each element edge 2^n times, so that quadratic displacements show. Existing series are
    kept unless `overwrite`; then the old series is removed as a whole. Raises OutputError before any computing, and
    InputError on a 1-d mesh.
    """

    def __init__(
        self,
        path: str | Path,
        *quantities: str,
        when: float | Sequence[float] | None = None,
        subdivision: int = 1,
        overwrite: bool = False,
    ) -> None:
        super().__init__(when)
        if not isinstance(path, (str, os.PathLike)) or not Path(path).name:
            raise InputError(f"VTK: path has to name the series, such as 'out/swelling', got {checks.shown(path)}")
        for quantity in quantities:
            checks.name("VTK: a quantity", quantity, "displacement")
        subdivision = checks.whole("VTK: subdivision", subdivision, 0, 5)
        checks.flag("VTK: overwrite", overwrite)
        self.path, self.quantities, self.subdivision, self.overwrite = Path(path), quantities, subdivision, overwrite

    def start(self, problem: Problem, begin: float, until: float) -> None:
        if problem.mesh.dim == 1:  # NGSolve's writer leaves coordinates and derivatives of 1-d meshes unset
            raise InputError("VTK: NGSolve writes no 1-d meshes; watch a column with Probe, or run it as a strip")
        outputs = problem.state.outputs()
        for name in self.quantities:
            if name not in outputs:
                raise InputError(f"VTK: there is no quantity {name!r}; the model gives {', '.join(outputs)}")
        names = list(self.quantities or outputs)
        if "displacement" not in names:
            names.append("displacement")
        self._prepare_folder()
        self._writer = VTKOutput(
            problem.mesh,
            coefs=[_three_dimensional(outputs[name]) for name in names],
            names=names,
            filename=str(self.path),
            subdivision=self.subdivision,
        )
        super().start(problem, begin, until)

    def _prepare_folder(self) -> None:
        folder = self.path.parent
        if not folder.is_dir():
            raise OutputError(f"VTK: there is no folder {folder}; make it first")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise OutputError(f"VTK: the folder {folder} cannot be written to")
        series = self.path.with_name(self.path.name + ".pvd")
        pieces = [*folder.glob(f"{self.path.name}.vtu"), *folder.glob(f"{self.path.name}_step*.vtu")]
        if (series.exists() or pieces) and not self.overwrite:
            raise OutputError(f"VTK: {series} exists; choose another name or pass overwrite=True")
        for file in [series, *pieces]:
            file.unlink(missing_ok=True)

    def record(self, problem: Problem, time: float) -> None:
        written = Path(self._writer.Do(time=time) + ".vtu")
        if not written.is_file() or written.stat().st_size == 0:
            raise OutputError(f"VTK: {written} could not be written (disk full?)")


def _three_dimensional(field: CoefficientFunction) -> CoefficientFunction:
    shape = tuple(field.dims)
    if not shape:
        return field
    if len(shape) == 1:
        return CF(tuple(field[i] for i in range(shape[0])) + (0.0,) * (3 - shape[0]))
    rows = [[field[i, j] if i < shape[0] and j < shape[1] else CF(0.0) for j in range(3)] for i in range(3)]
    return CF(tuple(entry for row in rows for entry in row), dims=(3, 3))
