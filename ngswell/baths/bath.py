"""Salt baths on named boundaries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ngsolve import CF, VOL, CoefficientFunction, InnerProduct, Integrate, Mesh

from ngswell import checks
from ngswell.baths.lagged import Lagged
from ngswell.baths.multiplier import Multiplier
from ngswell.baths.nitsche import Nitsche
from ngswell.baths.penalty import Penalty
from ngswell.baths.prescribed import Essential, Frozen
from ngswell.baths.treatment import Prescribed, Surroundings, Treatment, Weak
from ngswell.baths.vessel import Vessel
from ngswell.errors import InputError
from ngswell.mesh.points import points, vertices_of
from ngswell.models.model import BathFields, Model
from ngswell.models.one_number import OneNumber
from ngswell.models.term import Role, Term
from ngswell.physics.kinematics import Kinematics
from ngswell.schedules import Schedule, schedule


def checked_salt(what: str, concentration: object) -> float:
    """A salt concentration of a bath [mol/l] as a float, within the possible."""
    hint = "for pure water use a small one, such as 1e-6; 1 mol/l = 1000 mol/m³"
    return checks.number(what, concentration, "mol/l", *SALT, hint=hint)


SALT = (1e-12, 10.0)
"""Salt concentrations that a bath may have [mol/l]. Water itself has 1e-7 of ions."""


TREATMENTS: tuple[Treatment, ...] = (
    Essential(), Penalty(relative=1e4), Nitsche(), Multiplier(), Lagged(), Frozen(),
)  # fmt: skip
"""The treatments of ngswell, with their defaults. A bath without one gets the first that suits the model."""


def default_treatment(model: Model, in_vessel: bool = False) -> Treatment:
    """Exact where the model's unknowns in equilibrium with a bath do not depend on the charge, else the paper's penalty.

    A bath that is an unknown itself (`in_vessel`) cannot be prescribed.
    """
    fitting = (treatment for treatment in TREATMENTS if treatment.suits(model))
    return next(treatment for treatment in fitting if not in_vessel or checks.is_a(treatment, Weak))


@dataclass(frozen=True)
class Bath:
    """A salt bath on a boundary ("top" or "top|left").

    `c` is the salt concentration c̄ [mol/l] (none for models without ions), `P` the hydraulic pressure P̄ [N/mm²]; each a
    number or a schedule. A bath is a fluid: P̄ presses on the boundary, with −P̄ n per current area, beside all other loads.
    With `porous_plate=True` a porous plate on the boundary carries P̄, so that the body bears nothing but its other loads.
    Without a `treatment` the model's default applies. A bath is infinite unless it has a `vessel`: then `c` is what it
    starts with. Raises InputError for a concentration that is below 1e-12 or beyond 10 mol/l. `salt` and `hydraulic` are the
    histories of c and P.
    """

    boundary: str
    c: float | Schedule | None = None
    P: float | Schedule = 0.0
    treatment: Treatment | None = None
    porous_plate: bool = False
    vessel: Vessel | None = None
    salt: Schedule | None = field(init=False, repr=False, compare=False)
    hydraulic: Schedule = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        checks.name("a bath's boundary", self.boundary, "top|left")
        what = f"bath on {self.boundary!r}"
        salt = None if self.c is None else schedule(f"{what}: concentration [mol/l]", self.c)
        checks.set_fields(self, salt=salt, hydraulic=schedule(f"{what}: P [N/mm²]", self.P))
        for value in () if salt is None else salt.values:
            checked_salt(f"{what}: concentration", value)
        for value in self.hydraulic.values:
            if not abs(value) <= 1e3:
                raise InputError(f"{what}: P = {value!r} N/mm² is beyond ±1e3; 1 N/mm² = 1e6 Pa")
        checks.flag(f"{what}: porous_plate", self.porous_plate)
        if self.treatment is not None:
            choices = "Penalty(...), Nitsche(), Multiplier(), Lagged(), Frozen(), Essential(), or a Weak or Prescribed one"
            checks.instance(f"{what}: treatment", self.treatment, Weak | Prescribed, choices)
        if self.vessel is not None:
            checks.instance(f"{what}: vessel", self.vessel, Vessel, "a Vessel(volume)")
            if salt is not None and len(set(salt.values)) > 1:
                raise InputError(f"{what}: in a vessel the concentration is an unknown; c is the number that it starts with")
            if not self.hydraulic.uniform:
                raise InputError(f"{what}: in a vessel, which is stirred, P is a number or a Ramp")

    @property
    def schedules(self) -> tuple[Schedule, ...]:
        """Its histories."""
        own = (self.hydraulic,) if self.salt is None else (self.salt, self.hydraulic)
        return own if self.vessel is None else (*own, *self.vessel.schedules)

    def at(self, time: float) -> tuple[CoefficientFunction | float | None, CoefficientFunction | float]:
        """Salt concentration [mol/l] (None without ions) and hydraulic pressure [N/mm²] at `time` [s]."""
        return (None if self.salt is None else self.salt.at(time)), self.hydraulic.at(time)

    @property
    def concentrations(self) -> tuple[float, ...]:
        """All salt concentrations that its histories pass [mol/l]."""
        fed = () if self.vessel is None else self.vessel.schedules[-1].values
        return (() if self.salt is None else self.salt.values) + fed

    def numbers(self, size: float) -> dict[str, OneNumber]:
        """The unknowns that it brings, by the balance of the gel that they face; concentrations have the natural `size`."""
        if self.vessel is None or self.salt is None:
            return {}
        return self.vessel.numbers(self.boundary, self.salt.values[0], size)

    def loads(
        self, kinematics: Kinematics, u: CoefficientFunction, v: CoefficientFunction, fields: BathFields
    ) -> list[Term]:
        """The pressure on the body in the balance of total stress (16).

        Nothing where P̄ is 0 throughout, or where a porous plate carries it.
        """
        if self.porous_plate or not any(self.hydraulic.values):
            return []
        return [pressing("pressure of the bath", self.boundary, fields.P, kinematics, u, v)]

    def check_in(self, surroundings: Surroundings) -> None:
        """Refuse boundaries that the mesh lacks, histories that its places do not allow, a treatment that does not suit."""
        mesh, model = surroundings.mesh, surroundings.model
        surroundings.check_boundary("bath", self.boundary)
        check_histories(mesh, self.boundary, self.schedules)
        if not area(mesh, surroundings.kinematics, self.boundary) > 0:
            what = "vessel" if self.vessel is not None else "bath"
            raise InputError(f"{what} on {self.boundary!r}: the boundary has no area, so the bath is connected to nothing")
        treatment = surroundings.treatment(self)
        if not treatment.suits(model):
            choices = ", ".join(type(other).__name__ for other in TREATMENTS if other.suits(model))
            raise InputError(f"bath on {self.boundary!r}: {type(model).__name__} has no {treatment!r}; it has {choices}")
        treatment.check_in(surroundings, self.boundary)
        if self.vessel is not None:
            self._check_vessel(surroundings, treatment)

    def _check_vessel(self, surroundings: Surroundings, treatment: Treatment) -> None:
        """Refuse a vessel where nothing or no one balance could tell what its bath gains."""
        what, mesh, model = f"vessel on {self.boundary!r}", surroundings.mesh, surroundings.model
        if "cations" not in model.balanced:
            raise InputError(f"{what}: {type(model).__name__} does not balance salt; take Potential or Concentration")
        if not checks.is_a(treatment, Weak):
            weak = ", ".join(type(t).__name__ for t in TREATMENTS if checks.is_a(t, Weak) and t.suits(model))
            raise InputError(
                f"{what}: {treatment!r} prescribes the concentration, which is an unknown in a vessel; take {weak}, or "
                "leave the treatment out"
            )
        for other in surroundings.baths:
            if other is not self and vertices_of(mesh, self.boundary) & vertices_of(mesh, other.boundary):
                raise InputError(
                    f"{what}: it touches the bath on {other.boundary!r}, and what leaves there would belong to both; put "
                    f"a sealed side between them, or make them one, Bath({self.boundary + '|' + other.boundary!r}, ...)"
                )


def area(mesh: Mesh, kinematics: Kinematics, boundary: str) -> float:
    """Reference area of a boundary [mm²], in plane strain [mm], in a column 1."""
    return float(Integrate(CF(1.0) * kinematics.weight, mesh, definedon=mesh.Boundaries(boundary)))


def pressing(
    name: str,
    boundary: str,
    pressure: CoefficientFunction,
    kinematics: Kinematics,
    u: CoefficientFunction,
    v: CoefficientFunction,
) -> Term:
    """A pressure [N/mm²] on the current boundary, −P n per current area: +∫ P Cof(F) N · v dA in the balance of momentum."""
    power = InnerProduct(kinematics.area_vector(u), v)
    return Term("momentum", name, pressure * power, role=Role.LOAD, boundary=boundary)


def check_histories(mesh: Mesh, boundary: str, histories: Sequence[Schedule]) -> None:
    """Refuse histories that a boundary's places do not allow."""
    region = VOL if mesh.dim == 1 else mesh.Boundaries(boundary)  # an end has no points
    for history in histories:
        history.check_on(points(mesh, region, 4))
