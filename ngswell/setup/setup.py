"""A setup: mesh, motion, material, model, supports, baths and loads, checked. It knows nothing of fields and clocks."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from ngsolve import CoefficientFunction, Mesh
from numpy.typing import NDArray

from ngswell import checks
from ngswell.baths.bath import Bath, checked_salt, default_treatment
from ngswell.baths.treatment import Charge, Prescribed, Treatment, Weak
from ngswell.calls import in_turn
from ngswell.errors import InputError
from ngswell.mesh.parts import Sides
from ngswell.mesh.points import digest, points, vertices_of
from ngswell.mesh.shape import MeshShape
from ngswell.mesh.shares import check_ranks
from ngswell.mesh.soundness import check_cells, check_sides
from ngswell.models.model import Model
from ngswell.models.potential import Potential
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material
from ngswell.schedules import LARGEST, Ramp, Schedule
from ngswell.setup.charge import check_jumps
from ngswell.setup.displacements import Held, by_direction, check_displacements, held
from ngswell.setup.loads import Load
from ngswell.setup.rigid_motions import check_determined
from ngswell.setup.snapshot import Snapshot
from ngswell.setup.supports import Support
from ngswell.setup.units import check_units
from ngswell.team import team_of


@dataclass(frozen=True, kw_only=True)
class Setup:
    """An initial boundary-value problem of a swelling body. Units mm, N, s, K, mol/l throughout.

    The body starts undeformed, in Donnan equilibrium with `initial` (salt concentration [mol/l] and hydraulic
    pressure [N/mm²]; by default that of its baths at `start`, which then have to agree). `charge` multiplies the
    material's cfc0 over time. With an `origin`, which `Scene.after` sets, runs start from its fields instead. `compiled`
    has the terms over the body compiled to C++ (docs/speed.md). With `ranks` those that mpirun has started compute it
    together (docs/distributed.md). Raises InputError for anything that cannot be meant.
    """

    mesh: Mesh
    kinematics: Kinematics
    material: Material
    model: Model = Potential()
    supports: Sequence[Support] = ()
    baths: Sequence[Bath] = ()
    loads: Sequence[Load] = ()
    charge: Ramp = Ramp((0.0, 1.0))
    start: float = 0.0  # [s]
    initial: tuple[float | None, float] | None = None
    mesh_shape: MeshShape = field(init=False, repr=False, compare=False)
    sides: Sides = field(init=False, repr=False, compare=False)
    origin: Snapshot | None = None
    compiled: bool = False
    ranks: bool = False
    _made_with: dict[str, NDArray] = field(init=False, repr=False, compare=False)

    @in_turn
    def __post_init__(self) -> None:
        self._check_kinds()
        if self.kinematics.dimension != self.mesh.dim:
            raise InputError(
                f"{type(self.kinematics).__name__} needs a {self.kinematics.dimension}-d mesh, this one is {self.mesh.dim}-d"
            )
        check_cells(self.mesh)
        checks.set_fields(self, mesh_shape=MeshShape.of(self.mesh), sides=Sides(self.mesh))
        check_sides(self.sides)
        self.material.check_on(self.mesh)
        self.model.check(self.material, self.baths)
        check_jumps(self.material, self.model, self.sides)
        for value in self.charge.values:
            if not 0 <= value <= 100:
                raise InputError(f"charge factor {value!r} is outside 0 … 100; it multiplies cfc0")
        self._check_baths()
        for support in self.supports:
            support.check_in(self)
        check_displacements(self.supports, self, self.start if self.origin is None else None)
        still = (one for one in self.held() if not one.moves)
        self.kinematics.check(self.mesh, by_direction(self.kinematics.directions, still))
        wet = {number for bath in self.baths for number in vertices_of(self.mesh, bath.boundary)}
        check_determined(self.mesh, self.sides.parts, self.kinematics, self.held(), self.pins(), wet)
        for load in self.loads:
            load.check_in(self)
        self.initial_bath()  # refuses baths that differ at the start
        if self.origin is None:
            check_units(self.mesh, self.material, team_of(self.ranks))
        checks.set_fields(self, _made_with=self._values())

    # -- checks --------------------------------------------------------------------------------------------------------

    def _check_kinds(self) -> None:
        """Refuse pieces that are none of their kind; lists become tuples."""
        checks.instance("mesh", self.mesh, Mesh, "a mesh of NGSolve, as column, rectangle, box, from_occ and read_mesh make")
        motions = "Confined(), Cylindrical(), Spherical(), PlaneStrain(), Axisymmetric() or Spatial()"
        checks.instance("kinematics", self.kinematics, Kinematics, motions)
        checks.instance("material", self.material, Material, "a Material(...)")
        checks.instance("model", self.model, Model, "Potential(), Concentration(), LocalDonnan() or Uncharged()")
        checks.instance("charge", self.charge, Ramp, "a Ramp of factors on cfc0, such as Ramp((0, 0.0), (4000, 1.0))")
        checks.set_fields(
            self,
            supports=checks.several("supports", self.supports, Support, "Roller, Symmetry, Platen or Pin"),
            baths=checks.several("baths", self.baths, Bath, "Bath(...)"),
            loads=checks.several("loads", self.loads, Load, "Traction, Pressure, Obstacle, Weight or Efflux"),
            start=checks.number("start", self.start, "s", -LARGEST, LARGEST),
        )
        checks.flag("compiled", self.compiled)
        checks.flag("ranks", self.ranks)
        check_ranks(team_of(self.ranks), self.mesh)
        if self.origin is not None:
            checks.instance("origin", self.origin, Snapshot, "a snapshot, such as `result.end`")
            if self.origin.time != self.start:
                raise InputError(f"origin is of {self.origin.time:g} s, but start = {self.start:g} s; they have to agree")
        if self.initial is not None:
            initial = checks.as_tuple(self.initial)
            if initial is None or len(initial) != 2:
                pair = "(concentration [mol/l], hydraulic pressure [N/mm²])"
                raise InputError(f"initial has to be {pair}, got {checks.short(self.initial)}")
            salt, hydraulic = initial
            if salt is not None:
                salt = checked_salt("initial: concentration", salt)
            checks.set_fields(
                self, initial=(salt, checks.number("initial: hydraulic pressure", hydraulic, "N/mm²", -1e3, 1e3))
            )

    def check_boundary(self, what: str, boundary: str) -> list[str]:
        """The names in `boundary` ("a|b"); InputError for one that the mesh does not have."""
        known = sorted(set(self.mesh.GetBoundaries()))
        names = boundary.split("|")
        for name in names:
            if name not in known:
                raise InputError(f"{what}: the mesh has no boundary {name!r}; it has {', '.join(known)}")
            if re.escape(name) != name:
                raise InputError(f"{what}: boundary {name!r} has characters that NGSolve reads as a pattern; rename it")
        return names

    def check_surface(self, what: str, boundary: str) -> list[str]:
        """The same, of the surface of the body; InputError for one inside it."""
        return self.sides.of_surface(what, self.check_boundary(what, boundary))

    def _check_baths(self) -> None:
        taken: set[str] = set()
        for bath in self.baths:
            for name in self.check_surface("bath", bath.boundary):
                if name in taken:
                    raise InputError(f"bath on {bath.boundary!r}: boundary {name!r} already has a bath")
                taken.add(name)
            bath.check_in(self)

    def _values(self) -> dict[str, NDArray]:
        """Values of the fields of position, by what they belong to."""
        where = points(self.mesh)
        pieces = {f"the bath on {bath.boundary!r}": bath.schedules for bath in self.baths}
        pieces |= {f"loads[{number}]": load.schedules for number, load in enumerate(self.loads)}
        of_pieces = {
            f"a history of {name}": history.at(self.start)
            for name, histories in pieces.items()
            for history in histories
            if not history.uniform
        }
        fields = {**{f"the material's {name}": value for name, value in vars(self.material).items()}, **of_pieces}
        return {name: value(where) for name, value in fields.items() if isinstance(value, CoefficientFunction)}

    def check_unchanged(self) -> None:
        """Refuse fields of position, such as a Parameter, that have other values than when the setup was made."""
        for name, values in self._values().items():
            if not np.array_equal(values, self._made_with[name], equal_nan=True):
                raise InputError(
                    f"{name} has changed since the scene was made, which checked and used its values: make the scene anew"
                )

    # -- what models, pieces and problems ask --------------------------------------------------------------------------

    def held(self) -> list[Held]:
        """Directions that supports hold on boundaries, and how these move, in the order of the scene."""
        return list(held(self.supports, self))

    def fixed(self) -> dict[str, str]:
        """Boundaries ("a|b") on which each displacement component is held."""
        return by_direction(self.kinematics.directions, self.held())

    def pins(self) -> list[tuple[int, str]]:
        """Vertices at which a displacement component vanishes, with its direction."""
        return [pin for support in self.supports for pin in support.pins(self)]

    def treatment(self, bath: Bath) -> Treatment:
        """How equilibrium with `bath` is imposed: as it says, or by the model's default."""
        return default_treatment(self.model, bath.vessel is not None) if bath.treatment is None else bath.treatment

    @property
    def weak_baths(self) -> list[tuple[Bath, Weak]]:
        """Baths whose treatment adds terms to the balances."""
        treated = ((bath, self.treatment(bath)) for bath in self.baths)
        return [(bath, treatment) for bath, treatment in treated if isinstance(treatment, Weak)]

    @property
    def prescribed_baths(self) -> list[tuple[Bath, Prescribed]]:
        """Baths whose treatment prescribes values."""
        treated = ((bath, self.treatment(bath)) for bath in self.baths)
        return [(bath, treatment) for bath, treatment in treated if isinstance(treatment, Prescribed)]

    @property
    def looks_back(self) -> bool:
        """Whether a bath takes the charge of the last step: its states have a map of their own from step to step."""
        return any(treatment.charge_of is Charge.LAST_STEP for _, treatment in self.prescribed_baths)

    @cached_property
    def mesh_digest(self) -> str:
        """What tells its mesh from another, in every process."""
        return digest(self.mesh)

    @property
    def fluid_weight(self) -> tuple[float | Schedule, ...] | None:
        """Specific weight of the fluid, which drives seepage [N/mm³]; None without."""
        return next((load.fluid_weight for load in self.loads if load.fluid_weight is not None), None)

    @property
    def schedules(self) -> list[Schedule]:
        """All histories of the setup."""
        of_supports = (history for support in self.supports for history in support.schedules)
        of_loads = (history for load in self.loads for history in load.schedules)
        return [self.charge, *(history for bath in self.baths for history in bath.schedules), *of_loads, *of_supports]

    def initial_bath(self) -> tuple[CoefficientFunction | float | None, CoefficientFunction | float]:
        """Salt concentration [mol/l] and hydraulic pressure [N/mm²] that the initial state is in equilibrium with."""
        if self.initial is not None:
            if self.initial[0] is None and "cations" in self.model.balanced:
                raise InputError(f"initial: {type(self.model).__name__} needs a salt concentration [mol/l], got None")
            return self.initial
        if not self.baths:
            raise InputError("the scene has no bath: give initial=(concentration, hydraulic pressure)")
        first = self.baths[0]
        for bath in self.baths[1:]:
            if bath.at(self.start) != first.at(self.start):
                raise InputError(
                    f"baths on {first.boundary!r} and {bath.boundary!r} differ at the start: "
                    "give initial=(concentration, hydraulic pressure)"
                )
        return first.at(self.start)
