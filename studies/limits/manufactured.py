"""Manufactured solutions: chosen fields, and the sources under which they solve the system.

Everything here is written from the equations in the current configuration, with tensors of three dimensions throughout, and
shares no function with ngswell:

    P  = (τ − J p I) F⁻ᵀ,   τ = µ (B − I) + λ (1 − nS0)² [J/(1 − nS0) − J/(J − nS0)] I                  (16), (18)
    nF wF    = −K (grad p + cfc grad E),   nF c₊ w₊ = −nF D₊ (grad c + c grad E/Rθ) + c nF wF           (19), (20)
    grad E   = −Rθ/Θ [D_L/Rθ grad p − (D₋ − D₊) grad c + D₋ grad cfc],   cfc = (1 − nS0) cfc0/(J − nS0)   (13), (22)
    body force −Div P,   fluid source ∂J/∂t + Div W,   cation source ∂[(J − nS0) c]/∂t + Div J₊,   W = J F⁻¹ nF wF, ...

    bath     q̄ = ε (p − p_D), j̄ = ε (c − c_D) per current area J |F⁻ᵀ N|,
    c_D = sqrt(c̄² + cfc²/4) + cfc/2,   p_D = 2 Rθ [sqrt(c̄² + cfc²/4) − c̄]                                (23), (38)
    virtual bath   c̃ = sqrt[c (c − cfc)],   P = p − 2 Rθ (c − cfc/2 − c̃),   q̄ = ε P, j̄ = ε (c̃ − c̄)

The same fields are asked of both models. Where a bath is met exactly (prescribed, by Nitsche's method, by multipliers) the
chosen fields meet it: then c̃ and P are chosen and p, c follow.

Divergences are taken in the strong form, by differentiating the chosen fields, and every boundary gets the normal traction
and normal fluxes as well. A source in the weak form, ∫ W · Grad q, would repeat the model's integration by parts, and no
error in a measure of volume (2πr) or in the gradient of a test function could show.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from math import sqrt as root
from typing import Any, NamedTuple

import numpy as np
from ngsolve import (
    CF,
    CoefficientFunction,
    Det,
    Grad,
    GridFunction,
    Id,
    InnerProduct,
    Integrate,
    Inv,
    Mesh,
    Parameter,
    cos,
    grad,
    sin,
    specialcf,
    sqrt,
    x,
    y,
    z,
)
from ngsolve.meshes import MakeStructured2DMesh

from ngswell import (
    Axisymmetric,
    Bath,
    Concentration,
    Fixed,
    Material,
    Multiplier,
    Nitsche,
    Penalty,
    Pin,
    PlaneStrain,
    Potential,
    Roller,
    Scene,
    Spatial,
    box,
    rectangle,
)
from ngswell.baths.treatment import Treatment
from ngswell.errors import InputError, NgswellError
from ngswell.mesh.sizes import cell_size
from ngswell.models.term import Term
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.setup.supports import Support
from ngswell.stepping.steps import Step
from ngswell.stepping.timetable import same_time


class Chosen(NamedTuple):
    """The fields at one time: displacement components [mm], p [N/mm²], c [mol/l]."""

    u: tuple[CoefficientFunction, ...]
    p: CoefficientFunction
    c: CoefficientFunction


@dataclass(frozen=True)
class Cartesian:
    """Coordinates x, y(, z); in the plane nothing depends on z."""

    dimension: int
    measure = CF(1.0)

    def gradient(self, f: CoefficientFunction) -> CoefficientFunction:
        """Gradient of a scalar, three components."""
        return CF(tuple(f.Diff(s) for s in (x, y, z)[: self.dimension]) + (0.0,) * (3 - self.dimension))

    def vector_gradient(self, u: Sequence[CoefficientFunction]) -> CoefficientFunction:
        """Grad u, 3 × 3."""
        rows = [self.gradient(component) for component in u] + [CF((0.0, 0.0, 0.0))] * (3 - self.dimension)
        return CF(tuple(rows), dims=(3, 3))

    def divergence(self, w: CoefficientFunction) -> CoefficientFunction:
        return sum((w[j].Diff(s) for j, s in enumerate((x, y, z)[: self.dimension])), CF(0.0))

    def tensor_divergence(self, P: CoefficientFunction) -> CoefficientFunction:
        """Div P, one component a displacement."""
        return CF(tuple(self.divergence(CF((P[i, 0], P[i, 1], P[i, 2]))) for i in range(self.dimension)))

    def normal(self) -> CoefficientFunction:
        n = specialcf.normal(self.dimension)
        return CF(tuple(n[j] for j in range(self.dimension)) + (0.0,) * (3 - self.dimension))

    def discrete_gradient(self, u: GridFunction) -> CoefficientFunction:
        g, d = Grad(u), self.dimension
        return CF(tuple(g[i, j] if i < d and j < d else 0.0 for i in range(3) for j in range(3)), dims=(3, 3))


@dataclass(frozen=True)
class Cylindrical(Cartesian):
    """Coordinates r, z (the mesh's x and y), third the hoop direction."""

    dimension: int = 2
    measure = 2 * pi * x

    def vector_gradient(self, u: Sequence[CoefficientFunction]) -> CoefficientFunction:
        (u_r, u_z), zero = u, CF(0.0)
        return CF((u_r.Diff(x), u_r.Diff(y), zero, u_z.Diff(x), u_z.Diff(y), zero, zero, zero, u_r / x), dims=(3, 3))

    def divergence(self, w: CoefficientFunction) -> CoefficientFunction:
        return w[0].Diff(x) + w[0] / x + w[1].Diff(y)

    def tensor_divergence(self, P: CoefficientFunction) -> CoefficientFunction:
        along_r = P[0, 0].Diff(x) + P[0, 1].Diff(y) + (P[0, 0] - P[2, 2]) / x
        along_z = P[1, 0].Diff(x) + P[1, 1].Diff(y) + P[1, 0] / x
        return CF((along_r, along_z))

    def discrete_gradient(self, u: GridFunction) -> CoefficientFunction:
        g = Grad(u)
        return CF((g[0, 0], g[0, 1], 0.0, g[1, 0], g[1, 1], 0.0, 0.0, 0.0, u[0] / x), dims=(3, 3))


@dataclass(frozen=True)
class Parameters:
    """The material as plain numbers, µ, λ [N/mm²], K [mm⁴/(N s)], D± [mm²/s], cfc0 [mol/l], Rθ [N/mm² per mol/l]."""

    mu: float
    lam: float
    nS0: float
    cfc0: float
    D_plus: float
    D_minus: float
    K: float
    RT: float


class Exact:
    """What the chosen fields amount to at one time: stress, contents and fluxes on the reference configuration."""

    def __init__(self, chosen: Chosen, coordinates: Cartesian, parameters: Parameters) -> None:
        self.chosen, self.coordinates, self.m = chosen, coordinates, parameters

    @cached_property
    def displacement_gradient(self) -> CoefficientFunction:
        return self.coordinates.vector_gradient(self.chosen.u)

    @cached_property
    def F(self) -> CoefficientFunction:
        return Id(3) + self.displacement_gradient

    @cached_property
    def J(self) -> CoefficientFunction:
        return Det(self.F)

    @cached_property
    def cfc(self) -> CoefficientFunction:
        m = self.m
        return (1 - m.nS0) * m.cfc0 / (self.J - m.nS0)

    @cached_property
    def stress(self) -> CoefficientFunction:
        """First Piola-Kirchhoff stress P [N/mm²]."""
        m, J = self.m, self.J
        B = self.F * self.F.trans
        volumetric = m.lam * (1 - m.nS0) ** 2 * (J / (1 - m.nS0) - J / (J - m.nS0))
        return (m.mu * (B - Id(3)) + (volumetric - J * self.chosen.p) * Id(3)) * Inv(self.F).trans

    @cached_property
    def fluxes(self) -> tuple[CoefficientFunction, CoefficientFunction]:
        """W [mm/s] and J₊ [mol/l mm/s]."""
        m, J, c, cfc = self.m, self.J, self.chosen.c, self.cfc
        inverse = Inv(self.F)
        grad_p, grad_c, grad_cfc = (inverse.trans * self.coordinates.gradient(f) for f in (self.chosen.p, c, cfc))
        nF = 1 - m.nS0 / J
        D_L = cfc * m.K * m.RT / nF
        theta = m.D_plus * c + m.D_minus * (c - cfc) + D_L * cfc
        grad_E = -m.RT / theta * (D_L / m.RT * grad_p - (m.D_minus - m.D_plus) * grad_c + m.D_minus * grad_cfc)
        water = -m.K * (grad_p + cfc * grad_E)
        cations = -nF * m.D_plus * (grad_c + c / m.RT * grad_E) + c * water
        return J * inverse * water, J * inverse * cations

    @cached_property
    def contents(self) -> tuple[CoefficientFunction, CoefficientFunction]:
        """Fluid [-] and cations [mol/l] per reference volume."""
        content = self.J - self.m.nS0
        return content, content * self.chosen.c

    @cached_property
    def virtual_bath(self) -> tuple[CoefficientFunction, CoefficientFunction]:
        """P [N/mm²] and c̃ [mol/l] of the bath in equilibrium with the point."""
        p, c, cfc = self.chosen.p, self.chosen.c, self.cfc
        salt = sqrt(c * (c - cfc))
        return p - 2 * self.m.RT * (c - cfc / 2 - salt), salt

    @cached_property
    def fields(self) -> dict[str, CoefficientFunction]:
        """All scalar fields, by the names that models and outputs have for them."""
        P, salt = self.virtual_bath
        return {"p": self.chosen.p, "c": self.chosen.c, "cfc": self.cfc, "P": P, "salt": salt}

    def excess(self, c: float, by_potentials: bool) -> tuple[CoefficientFunction, CoefficientFunction]:
        """By how much the fields exceed equilibrium with a bath of c̄ = `c` [mol/l]: p − p_D, c − c_D or P, c̃ − c̄."""
        if by_potentials:
            return self.fields["P"], self.fields["salt"] - c
        root = sqrt(c**2 + self.cfc**2 / 4)
        return self.chosen.p - 2 * self.m.RT * (root - c), self.chosen.c - root - self.cfc / 2

    @cached_property
    def area_stretch(self) -> CoefficientFunction:
        """Current area per reference area, J |F⁻ᵀ N| [-]."""
        push = Inv(self.F).trans * self.coordinates.normal()
        return self.J * sqrt(InnerProduct(push, push))


class Clock(Observer):
    """The times `before` and `now` of the present step [s], for the sources: from step to step, all of size `dt` [s]."""

    def __init__(self, dt: float) -> None:
        super().__init__()
        self.dt, self.before, self.now = dt, Parameter(-dt), Parameter(0.0)

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._until = until
        self._move(begin)

    def observe(self, problem: Problem, step: Step) -> None:
        if not same_time(step.time, self.now.Get()):
            raise NgswellError(f"the sources are those of t = {self.now.Get():.10g} s, the step ends at {step.time:.10g} s")
        if step.time < self._until:
            self._move(step.time)

    def _move(self, time: float) -> None:
        """To the step that begins at `time`."""
        self.before.Set(time)
        self.now.Set(time + self.dt)


@dataclass(frozen=True)
class ChosenSolution:
    """Fields chosen over time in their coordinates, the boundaries with area, and the bath if there is one."""

    chosen: Callable[[CoefficientFunction], Chosen]
    coordinates: Cartesian
    parameters: Parameters
    boundaries: str
    clock: Clock
    bath: Bath | None = None
    true_rate: bool = False
    """The sources hold the time derivative of the contents; else the difference quotient, so that time adds no error."""

    def at(self, time: CoefficientFunction) -> Exact:
        return Exact(self.chosen(time), self.coordinates, self.parameters)

    def rates(self) -> list[CoefficientFunction]:
        now, before = self.clock.now, self.clock.before
        if self.true_rate:
            return [content.Diff(now) for content in self.at(now).contents]
        pairs = zip(self.at(now).contents, self.at(before).contents, strict=True)
        return [(new - old) / (now - before) for new, old in pairs]

    @property
    def sealed(self) -> str:
        """Boundaries where the model has no flux of its own."""
        names = self.boundaries.split("|")
        if self.bath is not None and isinstance(self.bath.treatment, (Nitsche, Multiplier)):
            names.remove(self.bath.boundary)
        return "|".join(names)

    def sources(self, tests: Sequence[CoefficientFunction], by_potentials: bool) -> list[Term]:
        """Terms that turn the residual's zero into the chosen fields."""
        v, *of_contents = tests[:3]
        exact, at = self.at(self.clock.now), self.coordinates
        normal, dimension = at.normal(), at.dimension
        traction = exact.stress * normal
        held = CF(tuple(traction[i] for i in range(dimension)))
        terms = [
            Term("momentum", "body force", InnerProduct(at.tensor_divergence(exact.stress), v)),
            Term("momentum", "traction", -InnerProduct(held, v), boundary=self.boundaries),
        ]
        balances = list(zip(("fluid", "cations"), of_contents, strict=True))
        for (balance, test), rate, flux in zip(balances, self.rates(), exact.fluxes, strict=True):
            terms.append(Term(balance, "source", -(rate + at.divergence(flux)) * test))
            terms.append(Term(balance, "outflow", InnerProduct(flux, normal) * test, boundary=self.sealed))
        if self.bath is not None and isinstance(self.bath.treatment, Penalty):
            epsilon = self.bath.treatment.epsilon
            assert epsilon is not None, "the sources need the raw ε"
            for (balance, test), excess in zip(balances, exact.excess(SALT, by_potentials), strict=True):
                outflow = -epsilon * exact.area_stretch * excess * test
                terms.append(Term(balance, "outflow to the bath", outflow, boundary=self.bath.boundary))
        return terms

    def errors(self, problem: Problem) -> dict[str, float]:
        """L2 norms over the body of what the fields of `problem` are off at the clock's time, and of their gradients.

        p, c and cfc are the outputs; of models with other unknowns, these too. Of multipliers, the norms over the boundary
        of what the effluxes are off.
        """
        exact, at = self.at(self.clock.now), self.coordinates
        unknowns, found = dict(zip(problem.names, problem.fields.components, strict=True)), problem.state.outputs()
        u = unknowns.pop("u")
        differences = {
            "u": u - CF(exact.chosen.u),
            "p": found["p"] - exact.chosen.p,
            "c": found["c_plus"] - exact.chosen.c,
            "cfc": found["cfc"] - exact.cfc,
            "grad u": at.discrete_gradient(u) - exact.displacement_gradient,
        }
        for name in problem.model.balanced.values():
            wanted = exact.fields[name]
            differences[name] = unknowns[name] - wanted
            differences[f"grad {name}"] = _padded(grad(unknowns[name])) - at.gradient(wanted)
        # Squares of errors of degree k and of smooth fields: three orders more than the square of the displacement.
        order = 2 * problem.model.order + 3
        result = {
            name: Integrate((InnerProduct(e, e) * at.measure).Compile(), problem.mesh, order=order) ** 0.5
            for name, e in differences.items()
        }
        if self.bath is None or not isinstance(self.bath.treatment, Multiplier):
            return result
        boundary = self.bath.boundary
        h, m = cell_size(problem.mesh, boundary), problem.setup.material
        factors = (m.number("K") / h, m.number("D_plus") / h)
        for balance, factor, flux in zip(problem.model.balanced, factors, exact.fluxes, strict=True):
            name = f"efflux of {balance}"
            # The exact stretch stands for the discrete one, whose error is not the multiplier's.
            e = factor * unknowns[name] * exact.area_stretch - InnerProduct(flux, at.normal())
            region = problem.mesh.Boundaries(boundary)
            result[name] = Integrate(e * e * at.measure, problem.mesh, definedon=region, order=order) ** 0.5
        return result


def _padded(g: CoefficientFunction) -> CoefficientFunction:
    return CF(tuple(g[i] for i in range(g.dim)) + (0.0,) * (3 - g.dim))


@dataclass(frozen=True)
class Manufactured(Concentration):
    """A model under test, driven by the sources of a chosen solution."""

    solution: ChosenSolution | None = None

    def terms(self, state: Any, tests: Sequence[CoefficientFunction]) -> list[Term]:
        if self.solution is None:
            raise InputError("Manufactured needs a solution")
        return super().terms(state, tests) + self.solution.sources(tests, by_potentials=False)


@dataclass(frozen=True)
class ManufacturedPotential(Potential):
    """The other one."""

    solution: ChosenSolution | None = None

    def terms(self, state: Any, tests: Sequence[CoefficientFunction]) -> list[Term]:
        if self.solution is None:
            raise InputError("ManufacturedPotential needs a solution")
        return super().terms(state, tests) + self.solution.sources(tests, by_potentials=True)


# -- the cases ----------------------------------------------------------------------------------------------------------

# As stiff as that, the body stays stable under the tractions, which do not follow the surface (at µ = 0.3 the ring buckles).
NUMBERS: dict[str, Any] = {"mu": 0.6, "lam": 0.1, "nS0": 0.25, "cfc0": 0.4, "D_plus": 5e-4, "D_minus": 8e-4, "K": 1.07e-3}
RT = 8.3144e-3 * 298
SALT = 1.0
P_START = 2 * RT * (root(SALT**2 + NUMBERS["cfc0"] ** 2 / 4) - SALT)
C_START = root(SALT**2 + NUMBERS["cfc0"] ** 2 / 4) + NUMBERS["cfc0"] / 2
"""All fields start from u = 0 in Donnan equilibrium with 1 mol/l, as scenes do: exactly, in every space."""

SLOW, FAST = 1000.0, 1.0
"""Duration of the motion [s]. In 1000 s fluid and ions diffuse across the body's millimetre, in 1 s hardly across a cell."""

# What holds the body where the chosen displacement vanishes, and the boundaries that have area.
FLAT = [Roller("left", "x"), Roller("bottom", "y")]
CYLINDER = [Roller("left", "r"), Roller("bottom", "z")]
RING: list[Support] = [Roller("bottom", "z")]
BLOCK = [Roller("left", "x"), Roller("front", "y"), Roller("bottom", "z")]
AROUND, WITHOUT_AXIS, SIX = "bottom|right|top|left", "bottom|right|top", "back|left|front|right|bottom|top"


def ring(n: int) -> Mesh:
    return MakeStructured2DMesh(quads=True, nx=n, ny=n, mapping=lambda s, t: (0.5 + s, t))


def square(n: int) -> Mesh:
    return rectangle(1.0, 1.0, n, n)


def cube(n: int) -> Mesh:
    return box(1.0, 1.0, 1.0, n, n, n)


KINDS: dict[str, Any] = {
    "plane strain": (square, PlaneStrain(), Cartesian(2), FLAT, AROUND),
    "axisymmetric": (square, Axisymmetric(), Cylindrical(), CYLINDER, WITHOUT_AXIS),
    "ring": (ring, Axisymmetric(), Cylindrical(), RING, AROUND),
    "3-d": (cube, Spatial(), Cartesian(3), BLOCK, SIX),
}


def smooth(kind: str, duration: float) -> Callable[[Any], Chosen]:
    """Fields that no polynomial space holds. u is odd and p, c are even in x, as on the axis of a cylinder they must be."""

    def chosen(time: Any) -> Chosen:
        a = sin(time / duration) / np.sin(1.0)
        if kind == "3-d":
            return Chosen(
                (0.12 * a * sin(x) * cos(y) * cos(z / 2), 0.1 * a * sin(y) * cos(x), 0.15 * a * sin(z) * cos(x - y)),
                P_START + 0.05 * a * cos(x) * sin(1 + 2 * y) * cos(z),
                C_START + 0.2 * a * cos(1.5 * x) * sin(0.5 + y + z / 2),
            )
        return Chosen(
            (0.16 * a * sin(x) * cos(y / 2), 0.12 * a * sin(y) * cos(x)),
            P_START + 0.05 * a * cos(x) * sin(1 + 2 * y),
            C_START + 0.2 * a * cos(1.5 * x) * sin(0.5 + y),
        )

    return chosen


def in_equilibrium(kind: str, duration: float) -> Callable[[Any], Chosen]:
    """Smooth fields that meet a bath of `SALT` at P̄ = 0 on the top, with fluxes through it: c̃ = c̄ and P = 0 there."""

    def chosen(time: Any) -> Chosen:
        m, a = Parameters(**NUMBERS, RT=RT), sin(time / duration) / np.sin(1.0)
        u, *_ = smooth(kind, duration)(time)
        depth, across = (1 - z, cos(y / 2)) if kind == "3-d" else (1 - y, CF(1.0))
        salt = SALT + 0.2 * a * cos(1.5 * x) * across * sin(1.2 * depth)
        P = 0.05 * a * cos(x) * across * sin(2 * depth)
        cfc = Exact(Chosen(u, P, salt), KINDS[kind][2], m).cfc
        mean = sqrt(salt * salt + cfc * cfc / 4)
        return Chosen(u, P + 2 * RT * (mean - salt), mean + cfc / 2)

    return chosen


def affine(kind: str, duration: float) -> Callable[[Any], Chosen]:
    """Fields that every space holds, so that no error but that of the time remains."""

    def chosen(time: Any) -> Chosen:
        a = sin(time / duration) / np.sin(1.0)
        p, c = P_START + a * (0.05 * x - 0.03 * y), C_START + a * (0.1 * x + 0.15 * y)
        if kind == "3-d":
            u = (a * (0.15 * x + 0.06 * y - 0.05 * z), a * (0.1 * y + 0.07 * z), 0.12 * a * z)
            return Chosen(u, p + 0.02 * a * z, c - 0.05 * a * z)
        shear = 0.0 if kind == "ring" else 0.08
        return Chosen((a * (0.15 * x + shear * y), 0.1 * a * y), p, c)

    return chosen


PINS: dict[str, list[Support]] = {
    "plane strain": [Pin((0.0, 0.0), "xy"), Pin((1.0, 0.0), "y")],
    "ring": RING,
    "3-d": [Pin((0.0, 0.0, 0.0), "xyz"), Pin((1.0, 0.0, 0.0), "yz"), Pin((0.0, 1.0, 0.0), "z")],
}


BATH = Bath("top", c=SALT, treatment=Penalty(0.01))
"""Weak enough that neither p nor c is as good as prescribed: the condition itself is tested."""


def exact_bath(treatment: Treatment) -> Bath:
    """The bath that the fields `in_equilibrium` meet."""
    return Bath("top", c=SALT, treatment=treatment)


def errors(
    kind: str,
    order: int,
    cells: int,
    duration: float,
    steps: int = 2,
    fields: Callable[[str, float], Callable[[Any], Chosen]] = smooth,
    bath: Bath | None = None,
    model: type[Manufactured] | type[ManufacturedPotential] = Manufactured,
    true_rate: bool = False,
    **choices: Any,
) -> dict[str, float]:
    """Error norms at the end of the motion. `choices` are the model's."""
    make_mesh, motion, coordinates, supports, boundaries = KINDS[kind]
    parameters, clock = Parameters(**NUMBERS, RT=RT), Clock(duration / steps)
    solution = ChosenSolution(fields(kind, duration), coordinates, parameters, boundaries, clock, bath, true_rate)
    scene = Scene(
        mesh=make_mesh(cells),
        kinematics=motion,
        material=Material(**NUMBERS),
        model=model(order=order, solution=solution, **choices),
        supports=PINS[kind] if fields is affine else supports,
        baths=[bath] if bath else [],
        initial=(SALT, 0.0),
    )
    result = scene.run(duration, Fixed(clock.dt), [clock])
    scene.problem.restore(result.end)
    return solution.errors(scene.problem)


def orders(coarse: dict[str, float], fine: dict[str, float], ratio: float) -> dict[str, float]:
    """Observed orders between two meshes or steps whose sizes have this ratio."""
    return {name: float(np.log(coarse[name] / fine[name]) / np.log(ratio)) for name in fine}
