"""Terms as NGSolve's bilinear forms: residuals and tangents."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any

from netgen.meshing import NgException
from ngsolve import BaseMatrix, BaseVector, BilinearForm, BitArray, SymbolicEnergy, ds, dx, ngsglobals
from ngsolve.comp import SumOfIntegrals

from ngswell.models.term import Kind, Role, Term
from ngswell.problem.body import Body, NotDerivable, Unknowns
from ngswell.problem.compiling import Compile, bytecode, cpp
from ngswell.problem.discretisation import Discretisation
from ngswell.problem.lumping import VERTEX_RULES
from ngswell.problem.quadrature import BONUS_ORDER


class Form:
    """The sum of terms as a form of the fields; those of kind RATE with the factor `rates`, such as 1/Δt.

    Terms over the body are taken together and differentiated symbolically (`body`), where all of them can be. All others
    are an integral each, which NGSolve differentiates as it evaluates it. A form that is evaluated `often` is compiled as
    the setup says.
    """

    def __init__(
        self,
        discretisation: Discretisation,
        unknowns: Unknowns,
        terms: Sequence[Term],
        rates: Any = None,
        condense: bool = False,
        often: bool = False,
    ) -> None:
        self.condense, self._fields = condense, unknowns.fields
        self._discretisation, self._unknowns, self._rates = discretisation, unknowns, rates
        self._share = discretisation.share
        self._terms = terms
        self._compile = cpp if often and discretisation.setup.compiled else bytecode

    def apply(self, result: BaseVector) -> None:
        """The form at the present fields, on all degrees of freedom."""
        self._applied.Apply(self._fields.vec, result)
        self._share.team.sum(result)

    def linearise(self) -> BaseMatrix:
        """Its derivative at the present fields: of ranks the share of each, which their sum is made of.

        Raises NgException on all ranks where a cell's own unknowns cannot be eliminated.
        """
        failed: NgException | None = None
        try:
            with _symbolic():
                self.linearised.AssembleLinearization(self._fields.vec)
        except NgException as error:
            failed = error
        if self._share.team.any(failed is not None):
            raise failed or NgException("a matrix cannot be made on another rank")
        return self.linearised.mat

    @cached_property
    def _applied(self) -> BilinearForm:
        return self._made(lambda body, where: body.residual(self._compiled(where)) * self._dx(where))

    @cached_property
    def linearised(self) -> BilinearForm:
        """What `linearise` assembles, with the matrices of static condensation."""

        def tangent(body: Body, where: dict[str, BitArray]) -> SumOfIntegrals:
            integral = body.residual(bytecode) * self._dx(where)  # never evaluated
            if body.varies:
                integral.linearization = body.tangent(self._compiled(where)) * self._dx(where)
            return integral

        return self._made(tangent, self.condense)

    def _made(self, together: Callable[[Body, dict[str, BitArray]], SumOfIntegrals], condense: bool = False) -> BilinearForm:
        """A bilinear form of the terms, those over the body `together` but for those that stay apart."""
        result = BilinearForm(self._discretisation.space, condense=condense)
        bodies, apart = self._bodies
        with _symbolic():
            for body, where in bodies:
                result += together(body, where)
        for term in apart:
            result += self._over_body(term)
        for term in self._terms:
            if term.boundary is not None:
                result += self._over_boundary(term)
            elif term.lumps:
                result += self._at_corners(term)
        return result

    @cached_property
    def _bodies(self) -> tuple[list[tuple[Body, dict[str, BitArray]]], list[Term]]:
        """Terms over the body together, with where they are integrated, and those that stay apart."""
        inside = [term for term in self._terms if term.boundary is None]
        apart, joined = [term for term in inside if term.apart], [term for term in inside if not term.apart]
        try:
            return self._joined(joined), apart
        except NotDerivable:
            derivable: list[Term] = []
            for term in joined:
                (derivable if self._is_derivable(term) else apart).append(term)
        return self._joined(derivable), apart

    def _is_derivable(self, term: Term) -> bool:
        try:
            self._joined([term])
        except NotDerivable:
            return False
        return True

    def _joined(self, terms: Sequence[Term]) -> list[tuple[Body, dict[str, BitArray]]]:
        """All terms where contents are integrals, those that do not lump where contents are lumped."""
        storage = self._discretisation.storage
        steady = [term for term in terms if not term.lumps]
        parts: list[tuple[Sequence[Term], dict[str, BitArray]]] = [(terms, {})]
        if len(steady) < len(terms):
            parts = [(terms, {"definedonelements": storage.integrated}), (steady, {"definedonelements": storage.lumped})]
        return [(Body(self._unknowns, some, self._weight, self._rates), where) for some, where in parts if some]

    def _compiled(self, where: dict[str, BitArray]) -> Compile:
        """How to compile what is evaluated over all cells; where contents are lumped it is bytecode, for a few steps."""
        return bytecode if where.get("definedonelements") is self._discretisation.storage.lumped else self._compile

    def _dx(self, where: dict[str, BitArray]) -> Any:
        return dx(intrules=self._discretisation.rules, **(where or self._share.over_body))

    @property
    def _weight(self) -> Any:
        return self._discretisation.kinematics.weight

    def _over_body(self, term: Term) -> Any:
        where = {"definedonelements": self._discretisation.storage.integrated} if term.lumps else {}
        integrand = self._integrand(term, self._weight)
        if term.kind is not Kind.ENERGY:
            return integrand * self._dx(where)
        energy = SymbolicEnergy(integrand, definedonelements=self._share.cells)  # Variation forgets the elements
        for shape, rule in self._discretisation.rules.items():
            energy.SetIntegrationRule(shape, rule)
        return energy

    def _over_boundary(self, term: Term) -> SumOfIntegrals:
        mesh = self._discretisation.mesh
        region = mesh.Boundaries(term.boundary)
        # At the ends of a 1-d mesh NGSolve's normal points outwards as seen from the cell only.
        in_cells = term.normal_derivatives or (mesh.dim == 1 and term.role is Role.LOAD)
        integrand, share = self._integrand(term, self._weight), self._share
        if in_cells and share.factor is not None:
            integrand = share.factor * integrand
        where = {} if in_cells else share.over_sides
        return integrand * ds(definedon=region, bonus_intorder=BONUS_ORDER, skeleton=in_cells, **where)

    def _at_corners(self, term: Term) -> SumOfIntegrals:
        """A content that is lumped: at a corner no other function than that of its vertex is there."""
        storage = self._discretisation.storage
        integrand = self._integrand(term, storage.vertex_weights)
        return integrand * dx(intrules=VERTEX_RULES, definedonelements=storage.lumped)

    def _integrand(self, term: Term, weight: Any) -> Any:
        weighted = weight * term.integrand
        if term.kind is Kind.RATE and self._rates is not None:
            weighted = self._rates * weighted
        return weighted.Compile()


@contextmanager
def _symbolic() -> Iterator[None]:
    """Within it, bilinear integrals are made and assembled by their coefficients; both have to be."""
    before = ngsglobals.symbolic_integrator_uses_diff
    ngsglobals.symbolic_integrator_uses_diff = True
    try:
        yield
    finally:
        ngsglobals.symbolic_integrator_uses_diff = before
