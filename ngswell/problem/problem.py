"""A scene on its mesh: spaces, forms, the parameters that follow the clock, and the vectors of a run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from ngsolve import (
    CF,
    H1,
    VOL,
    BaseMatrix,
    BaseVector,
    BilinearForm,
    BitArray,
    Compress,
    FESpace,
    GridFunction,
    InnerProduct,
    Integrate,
    Parameter,
    Variation,
    ds,
    dx,
    x,
    y,
    z,
)
from numpy.typing import NDArray

from ngswell.baths.bath import Bath, BathFields, Lagged, Multiplier, Treatment, Weak
from ngswell.baths.sampling import BathBoundary, Slopes
from ngswell.baths.weak import weak_terms
from ngswell.mesh.points import points, points_and_corners, vertices
from ngswell.models.model import Setting, Term
from ngswell.schedules import Signal
from ngswell.setup.supports import Traction, Weight

if TYPE_CHECKING:
    from ngswell.scene import Scene

BONUS_ORDER = 2
"""Extra integration order: the pulled-back terms are rational in F."""


@dataclass(frozen=True)
class _BathInForms:
    bath: Bath
    treatment: Treatment
    concentration: Signal | None
    hydraulic: Signal

    @property
    def fields(self) -> BathFields:
        return BathFields(None if self.concentration is None else self.concentration.field, self.hydraulic.field)

    def set(self, time: float) -> None:
        self.hydraulic.set(time)
        if self.concentration is not None:
            self.concentration.set(time)


def _in_forms(bath: Bath, treatment: Treatment) -> _BathInForms:
    concentration = None if bath.concentration is None else bath.concentration.signal()
    return _BathInForms(bath, treatment, concentration, bath.pressure.signal())


@dataclass(frozen=True)
class Snapshot:
    """The fields at one time: what a run can go on from. `values` are all coefficients, in the order of the space."""

    time: float
    values: NDArray


class Problem:
    """The discrete system of a scene at one time step of backward Euler:

        r(x) = [S(x) − S(x_old)] / Δt + R(x) = 0,

    S the contents (terms of kind "rate"), R everything else. S(x_old) is a vector computed once a step, so no form sees an
    old state. Linearisations are NGSolve's.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.mesh, self.model, self.kinematics = scene.mesh, scene.model, scene.kinematics
        material = scene.material

        self._baths = [_in_forms(bath, scene.treatment(bath)) for bath in scene.baths]
        essential = "|".join(e.bath.boundary for e in self._baths if not isinstance(e.treatment, Weak))
        self.space = self.model.space(self.mesh, self.kinematics, scene.held(), essential)
        self.names = self.model.unknowns
        with_multipliers = "|".join(e.bath.boundary for e in self._baths if isinstance(e.treatment, Multiplier))
        if with_multipliers:
            traces = Compress(H1(self.mesh, order=self.model.order - 1, definedon=self.mesh.Boundaries(with_multipliers)))
            self.space = FESpace([*self.space.components, *(traces for _ in self.model.held)])
            self.names += tuple(f"efflux of {balance}" for balance in self.model.held)
        self.fields = GridFunction(self.space)
        spans = [self.space.Range(i) for i in range(len(self.names))]
        self.ranges = {name: slice(span.start, span.stop) for name, span in zip(self.names, spans, strict=True)}
        self.free = self._free_dofs()

        self.dt = Parameter(1.0)
        self.time = scene.start
        self._charge = Parameter(scene.charge.at(scene.start))

        trials, tests = (list(functions) for functions in self.space.TnT())
        weight = next((load for load in scene.loads if isinstance(load, Weight)), None)
        bath = self._baths[0].fields if self._baths else None

        setting = Setting(material, self.kinematics, self._charge, weight, bath)
        own = len(self.model.unknowns)  # the rest are multipliers
        state = self.model.state(trials[:own], setting)
        multipliers = list(zip(trials[own:], tests[own:], strict=True))
        self.terms = self.model.terms(state, tests[:own]) + self._boundary_terms(state, tests, multipliers)
        self.state = self.model.state(self.fields.components[:own], setting)

        self._system = BilinearForm(self.space)
        self._contents = BilinearForm(self.space)
        for term in self.terms:
            self._system += self._in_system(term)
            if term.kind == "rate":
                self._contents += self.integral(term)
        self._charges: dict[str | None, Any] = {None: None}
        if "cfc" in self.names:
            self._charges |= {of: GridFunction(self._component("cfc").space) for of in ("start", "last")}
        self._old_contents, self._work = (self.fields.vec.CreateVector() for _ in range(2))
        self._prescribed: list[tuple[NDArray, NDArray]] = []
        self.stages: list[tuple[float, float, NDArray]] = []

    # -- forms ---------------------------------------------------------------------------------------------------------

    def _boundary_terms(self, state: Any, tests: list, multipliers: list) -> list[Term]:
        terms = []
        for entry in self._baths:
            if isinstance(entry.treatment, Weak):
                boundary = entry.bath.boundary
                h = self.cell_size(boundary)
                terms += weak_terms(entry.treatment, self.model, state, tests, entry.fields, boundary, h, multipliers)
        for load in self.scene.loads:
            if isinstance(load, Traction):
                power = InnerProduct(CF(load.vector), tests[0])
                terms.append(Term("momentum", "traction", -power, boundary=load.boundary))
        return terms

    def integral(self, term: Term, factor: Any = None) -> Any:
        """A term over its part of the body or of its boundary, for a BilinearForm."""
        factor = self.kinematics.weight if factor is None else factor * self.kinematics.weight
        integrand = (factor * term.integrand).Compile()
        if term.boundary is not None:
            region = self.mesh.Boundaries(term.boundary)
            return integrand * ds(definedon=region, bonus_intorder=BONUS_ORDER, skeleton=term.normal_derivatives)
        integral = integrand * dx(bonus_intorder=BONUS_ORDER)
        return Variation(integral) if term.kind == "energy" else integral

    def _in_system(self, term: Term) -> Any:
        return self.integral(term, 1 / self.dt if term.kind == "rate" else None)

    def form(self, term: Term) -> BilinearForm:
        """One term alone, for ledgers and tests."""
        form = BilinearForm(self.space)
        form += self.integral(term)
        return form

    def cell_size(self, boundary: str) -> float:
        """Volume of the cells at a boundary over its area: their size normal to it [mm]."""
        region = self.mesh.Boundaries(boundary)
        nodes = {1: "vertices", 2: "edges", 3: "faces"}[self.mesh.dim]
        faces = {getattr(element, nodes)[0].nr for element in region.Elements()}
        cells = {cell.nr for cell in self.mesh.Elements(VOL) if any(face.nr in faces for face in cell.facets)}
        volumes = Integrate(CF(1.0), self.mesh, VOL, element_wise=True).NumPy()
        return float(volumes[sorted(cells)].sum() / Integrate(CF(1.0), self.mesh, definedon=region))

    def _free_dofs(self) -> BitArray:
        free = BitArray(self.space.FreeDofs())
        for dof in self.scene.pinned_dofs(self.space.components[0]):
            free.Clear(dof)
        return free

    @property
    def baths(self) -> dict[str, BathFields]:
        """The baths at the clock's time, by boundary."""
        return {entry.bath.boundary: entry.fields for entry in self._baths}

    # -- clock and states ----------------------------------------------------------------------------------------------

    def _component(self, name: str) -> GridFunction:
        return self.fields.components[self.names.index(name)]

    def set_time(self, time: float, charge_share: float = 1.0) -> None:
        """Move every schedule to `time` [s]; `charge_share` of the charge, for continuation."""
        self.time = time
        self._charge.Set(charge_share * self.scene.charge.at(time))
        for entry in self._baths:
            entry.set(time)

    def initialise(self, charge_share: float = 1.0) -> None:
        """The reference configuration in Donnan equilibrium with the initial bath, at the scene's start."""
        self.set_time(self.scene.start, charge_share)
        concentration, hydraulic = self.scene.initial_bath()
        bath = BathFields(None if concentration is None else CF(concentration), CF(hydraulic))
        cfc = self._charge * self.scene.material.cfc0
        self.fields.vec[:] = 0.0
        for name, value in self.model.equilibrium(bath, cfc, self.scene.material).items():
            self._component(name).Set(value)
        if "cfc" in self.names:
            self._component("cfc").Set(cfc)
            self._charges["start"].vec.data = self._component("cfc").vec
        self.initial = self.vector.copy()

    def snapshot(self, time: float) -> Snapshot:
        return Snapshot(time, self.vector.copy())

    def restore(self, snapshot: Snapshot) -> None:
        """Put the fields and the clock back to a snapshot."""
        self.set_time(snapshot.time)
        self.vector[:] = snapshot.values

    @property
    def vector(self) -> NDArray:
        """All coefficients, as a numpy view."""
        return self.fields.vec.FV().NumPy()

    def begin_step(self, time: float, dt: float, guess: NDArray | None = None, charge_share: float = 1.0) -> None:
        """Prepare the step of backward Euler from the fields to `time`; `guess` as first iterate.

        The prescribed values are not put into the fields: see `gap`.
        """
        self.contents(self._old_contents)
        if "cfc" in self.names:
            self._charges["last"].vec.data = self._component("cfc").vec
        self._begin(time, dt, guess, charge_share)

    def begin_stage(self, time: float, dt: float, old_contents: NDArray, guess: NDArray) -> None:
        """Prepare a stage of a Runge–Kutta step: like a step of backward Euler of size `dt` from `old_contents`."""
        self._old_contents.FV().NumPy()[:] = old_contents
        self._begin(time, dt, guess)

    def _begin(self, time: float, dt: float, guess: NDArray | None, charge_share: float = 1.0) -> None:
        self.dt.Set(dt)
        self.set_time(time, charge_share)
        self._prescribed = self._prescribed_values()
        if guess is not None:
            self.vector[:] = guess

    def gap(self) -> NDArray:
        """What the fields exceed the prescribed values by, where there are any; zero elsewhere."""
        gap = np.zeros(self.vector.size)
        for dofs, values in self._prescribed:
            gap[dofs] = self.vector[dofs] - values
        return gap

    def _prescribed_values(self) -> list[tuple[NDArray, NDArray]]:
        """Degrees of freedom and values of p and c on the boundaries of strongly treated baths.

        Where two baths meet, the one that stands first in the scene prescribes: what comes last in `gap` counts.
        """
        found: list[tuple[NDArray, NDArray]] = []
        for entry in self._baths:
            if isinstance(entry.treatment, Weak):
                continue
            cfc = self._sampled(self._charges[entry.treatment.charge_of], entry)
            for name, value in self.model.equilibrium(entry.fields, cfc, self.scene.material).items():
                on_boundary = GridFunction(self._component(name).space)
                on_boundary.Set(value, definedon=self.mesh.Boundaries(entry.bath.boundary))
                dofs = self._bath_dofs[name, entry.bath.boundary]
                found.append((self.ranges[name].start + dofs, on_boundary.vec.FV().NumPy()[dofs]))
        return found[::-1]

    def _sampled(self, charge: Any, entry: _BathInForms) -> Any:
        """The charge that a bath's prescribed values follow: `charge` itself, or what a `Lagged` rule makes of it."""
        rule = entry.treatment.rule if isinstance(entry.treatment, Lagged) else None
        if rule is None:
            return charge
        boundary = self._bath_boundaries[entry.bath.boundary]
        wanted = self.model.equilibrium(entry.fields, charge, self.scene.material)
        slopes = Slopes(*(boundary.values(wanted[name].Diff(charge)) for name in ("p", "c")))
        sampled = GridFunction(charge.space)  # its first coefficients are the values at the vertices
        at_vertices = charge.vec.FV().NumPy()[: self.mesh.nv]
        sampled.vec.FV().NumPy()[boundary.vertices] = rule.sample(at_vertices, boundary, slopes)
        return sampled

    @cached_property
    def _bath_boundaries(self) -> dict[str, BathBoundary]:
        baths = "|".join(self.baths)
        return {boundary: BathBoundary(self.mesh, boundary, baths, self.kinematics.weight) for boundary in self.baths}

    @cached_property
    def _bath_dofs(self) -> dict[tuple[str, str], NDArray]:
        """Degrees of freedom of the unknowns that baths hold, on each of their boundaries."""
        return {
            (name, boundary): np.flatnonzero(list(self._component(name).space.GetDofs(self.mesh.Boundaries(boundary))))
            for name in self.model.held.values()
            for boundary in self.baths
        }

    # -- the discrete system -------------------------------------------------------------------------------------------

    def residual(self, result: BaseVector) -> None:
        """r at the present fields, on all degrees of freedom (constrained ones hold reactions)."""
        self._system.Apply(self.fields.vec, result)
        result.data -= (1 / self.dt.Get()) * self._old_contents

    def linearise(self) -> BaseMatrix:
        """dr/dx at the present fields, on all degrees of freedom."""
        self._system.AssembleLinearization(self.fields.vec)
        return self._system.mat

    @cached_property
    def condensed(self) -> BilinearForm | None:
        """The system without the unknowns inside cells, to be assembled like `linearise`; None where it gains nothing.

        Integrals over cell sides with normal derivatives reach inside the cells, from outside what NGSolve eliminates.
        """
        inside = sum(self.space.FreeDofs()) - sum(self.space.FreeDofs(True))
        if not inside or any(term.normal_derivatives for term in self.terms):
            return None
        form = BilinearForm(self.space, condense=True)
        for term in self.terms:
            form += self._in_system(term)
        return form

    def contents(self, result: BaseVector) -> None:
        """S at the present fields: its sum over the vertex functions of p or c is the fluid or the salt held."""
        self._contents.Apply(self.fields.vec, result)

    def outflow(self, result: BaseVector) -> None:
        """R at the present fields and time, which the contents fall by in unit time, on all degrees of freedom."""
        self._system.Apply(self.fields.vec, result)
        self._contents.Apply(self.fields.vec, self._work)
        result.data -= (1 / self.dt.Get()) * self._work

    @cached_property
    def _quadrature(self) -> NDArray:
        return points(self.mesh, VOL, 2 * self.model.order + BONUS_ORDER)

    @cached_property
    def _bounds(self) -> dict[str, tuple[Any, NDArray]]:
        """What has to stay positive, and where: at the forms' own points; the fluid content at the cells' corners too, where
        cells turn over first."""
        everywhere = points_and_corners(self.mesh, 2 * self.model.order + BONUS_ORDER)
        bounds = {"fluid content J − nS0": (self.state.content.Compile(), everywhere)}
        return bounds | self._at_own_points(self.model.bounds(self.state))

    @cached_property
    def _solution_bounds(self) -> dict[str, tuple[Any, NDArray]]:
        if any(isinstance(entry.treatment, Lagged) for entry in self._baths):
            return {}  # there to be watched as it goes wrong: its oscillation drives anions below zero
        return self._at_own_points(self.model.solution_bounds(self.state))

    def _at_own_points(self, bounds: dict[str, Any]) -> dict[str, tuple[Any, NDArray]]:
        return {name: (field.Compile(), self._quadrature) for name, field in bounds.items()}

    def inadmissible(self) -> tuple[str, tuple[float, ...]] | None:
        """What leaves the physical range at a monitored point, and where; None if nothing does."""
        return self._not_positive(self._bounds)

    def inadmissible_solution(self) -> tuple[str, tuple[float, ...]] | None:
        """The same of what only a solution has to keep positive."""
        return self._not_positive(self._solution_bounds)

    def _not_positive(self, bounds: dict[str, tuple[Any, NDArray]]) -> tuple[str, tuple[float, ...]] | None:
        for name, (field, where) in bounds.items():
            values = field(where).ravel()
            worst = int(np.argmin(np.where(np.isfinite(values), values, -np.inf)))
            if not values[worst] > 0:
                return name, tuple(CF((x, y, z)[: self.mesh.dim])(where[worst : worst + 1]).ravel())
        return None

    @cached_property
    def references(self) -> dict[str, float]:
        """A size of each unknown that the scene itself sets, so that tolerances need no units."""
        scene = self.scene
        corners = vertices(self.mesh)
        length = float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0)))
        charge = scene.material.largest("cfc0", self.mesh) * max(map(abs, scene.charge.values))
        baths = [value for bath in scene.baths if bath.concentration for value in bath.concentration.values]
        own = self.model.references(max([charge, *baths]), scene.material.largest("mu", self.mesh), length)
        multipliers = self.names[len(own) :]  # in the units of p and c
        return own | {name: own[unknown] for name, unknown in zip(multipliers, self.model.held.values(), strict=False)}

    def worst(self, vector: NDArray) -> tuple[str, tuple[float, ...]]:
        """The unknown with the largest entry of `vector` in units of its reference, and the vertex [mm] where it is."""
        name = max(self.model.unknowns, key=lambda n: _largest(vector[self.ranges[n]]) / self.references[n])
        part = np.abs(vector[self.ranges[name]])
        per_component = part.reshape(-1, len(part) // self._components(name))[:, : self.mesh.nv].max(axis=0)
        vertex = int(np.argmax(np.where(np.isfinite(per_component), per_component, np.inf)))
        return name, tuple(self.mesh.vertices[vertex].point)

    def _components(self, name: str) -> int:
        return self.kinematics.dimension if name == "u" else 1


def _largest(values: NDArray) -> float:
    largest = float(np.abs(values).max())
    return largest if np.isfinite(largest) else np.inf
