"""Terms over the body as coefficients of operators on test and trial functions, by NGSolve's symbolic differentiation."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any, NamedTuple

from netgen.meshing import NgException
from ngsolve import CF, CacheCF, CoefficientFunction, GridFunction, InnerProduct, dx, grad

from ngswell.models.term import Kind, Term
from ngswell.problem.compiling import Compile


class NotDerivable(Exception):
    """A term has an operator or a function that is not differentiated symbolically."""


class Unknowns(NamedTuple):
    """Trial and test functions and the fields of a problem, one an unknown."""

    trials: Sequence[CoefficientFunction]
    tests: Sequence[CoefficientFunction]
    fields: GridFunction


class Body:
    """The residual of terms over the body and its derivative, as integrands; those of kind RATE with the factor `rates`.

    With W_l the operators on trial functions (Grad u, p, grad p, ...) and T_k those on test functions they are

        residual Σ_k R_k · T_k,    tangent Σ_kl T_k · D_kl W_l,   D_kl = ∂R_k/∂W_l.

    All R_k are compiled together, and all D_kl, and evaluated once a cell, at the fields. By itself a form evaluates the
    whole integrand for each component of a test function and, for the tangent, of a trial function.

    Raises NotDerivable.
    """

    def __init__(self, unknowns: Unknowns, terms: Sequence[Term], weight: Any, rates: Any = None) -> None:
        try:
            total = _sum([_integrand(unknowns, term, weight, rates) for term in terms])
            total, tests = _unified(total, unknowns.tests, trial=False)
            if not tests:
                raise NotDerivable("the terms are zero")
            total, trials = _unified(total, unknowns.trials, trial=True)
            self._tests, self._trials = ([operator.function for operator in operators] for operators in (tests, trials))
            self._rows = [_flat(total.Diff(test)) for test in self._tests]
            # Powers of a GridFunction cannot be differentiated by it, those of a multiple can.
            at = [(1.0 * operator.on(unknowns.fields.components)).MakeVariable() for operator in trials]
            at_fields = total.Replace(dict(zip(self._trials, at, strict=True)))
            self._values = CF(tuple(_flat(at_fields.Diff(test)) for test in self._tests))
            self._columns = [self._values.Diff(variable).Reshape((self._values.dim, variable.dim)) for variable in at]
        except NgException as refused:
            raise NotDerivable(str(refused)) from refused

    @property
    def varies(self) -> bool:
        """Whether the residual depends on the fields at all."""
        return bool(self._trials)

    def residual(self, compile: Compile) -> CoefficientFunction:
        """Σ R_k · T_k."""
        values, start, parts = CacheCF(compile(self._values)).Freeze(), 0, []
        for test in self._tests:
            parts.append(_dot(_part(values, start, test.dim), test))
            start += test.dim
        return _sum(parts)

    def tangent(self, compile: Compile) -> CoefficientFunction:
        """Σ T_k · D_kl W_l."""
        blocks, start = [], 0
        for test, row in zip(self._tests, self._rows, strict=True):
            present = {id(trial) for trial in (InnerProduct(row, row) * dx).GetProxies(True)}
            mine = [pair for pair in zip(self._trials, self._columns, strict=True) if id(pair[0]) in present]
            blocks += [(test, trial, column[start : start + test.dim, 0 : trial.dim]) for trial, column in mine]
            start += test.dim
        values = CacheCF(compile(CF(tuple(_flat(block) for _, _, block in blocks))))
        parts, start = [], 0
        for of_test in (list(group) for _, group in groupby(blocks, lambda block: id(block[0]))):
            size = sum(block.dim for _, _, block in of_test)
            parts.append(_row(CacheCF(_part(values, start, size)).Freeze(), of_test))
            start += size
        return _sum(parts)


Block = tuple[CoefficientFunction, CoefficientFunction, CoefficientFunction]
"""An operator on a test and one on a trial function, and the derivative that goes with them."""


def _row(values: CoefficientFunction, blocks: Sequence[Block]) -> CoefficientFunction:
    """Σ_l T · D_l W_l; `values` are the components of all D_l, one after the other."""
    parts, start = [], 0
    for test, trial, block in blocks:
        mine = _part(values, start, block.dim)
        start += block.dim
        if test.dim == 1:
            parts.append(_dot(mine, trial) * _scalar(test))
        elif trial.dim == 1:
            parts.append(_dot(mine, test) * _scalar(trial))
        else:
            parts.append(InnerProduct(mine.Reshape((test.dim, trial.dim)) * _flat(trial), _flat(test)))
    return _sum(parts)


def _integrand(unknowns: Unknowns, term: Term, weight: Any, rates: Any) -> CoefficientFunction:
    """A term as an integrand that is linear in the test functions; of an energy, its variation."""
    weighted = weight * term.integrand
    if term.kind is Kind.ENERGY:
        operators = (_operator(function, unknowns.trials) for function in (weighted * dx).GetProxies(True))
        # Not along the test function: Diff would then take the gradients of an unknown for functions of it as well.
        return _sum([_dot(_flat(weighted.Diff(o.function)), o.on(unknowns.tests)) for o in operators])
    return rates * weighted if term.kind is Kind.RATE and rates is not None else weighted


class Operator(NamedTuple):
    """A trial or test function, or its gradient: of which unknown."""

    function: CoefficientFunction
    unknown: int
    is_gradient: bool

    def on(self, functions: Sequence[CoefficientFunction]) -> CoefficientFunction:
        """The same of other functions, one an unknown."""
        mine = functions[self.unknown]
        return grad(mine) if self.is_gradient else mine


def _operator(proxy: CoefficientFunction, functions: Sequence[CoefficientFunction]) -> Operator:
    for unknown, function in enumerate(functions):
        if proxy is function:
            return Operator(proxy, unknown, False)
        if proxy.primary is function and tuple(proxy.dims) == tuple(function.Deriv().dims):
            return Operator(proxy, unknown, True)
    raise NotDerivable(f"neither an unknown nor its gradient: {proxy}")


def _unified(
    total: CoefficientFunction, functions: Sequence[CoefficientFunction], trial: bool
) -> tuple[CoefficientFunction, list[Operator]]:
    """`total` with one object for each operator on `functions`, and these; NGSolve has several for some gradients."""
    found: dict[tuple[int, bool], Operator] = {}
    again = {}
    for proxy in (total * dx).GetProxies(trial):
        operator = _operator(proxy, functions)
        first = found.setdefault(operator[1:], operator)
        if first is not operator:
            again[proxy] = first.function
    return total.Replace(again) if again else total, list(found.values())


def _dot(values: CoefficientFunction, operator: CoefficientFunction) -> CoefficientFunction:
    if operator.dim == 1:
        return _scalar(values) * _scalar(operator)
    return InnerProduct(values, _flat(operator))


def _part(values: CoefficientFunction, start: int, size: int) -> CoefficientFunction:
    """Components of a vector; a scalar where it is one."""
    return _scalar(values) if values.dim == 1 else values[start] if size == 1 else values[start : start + size]


def _scalar(function: CoefficientFunction) -> CoefficientFunction:
    """A function of one component without dimensions."""
    dims = len(function.dims)
    return function[(0,) * dims] if dims > 1 else function[0] if dims == 1 else function


def _flat(function: CoefficientFunction) -> CoefficientFunction:
    """Its components as a vector, those of a scalar as well."""
    return function.Reshape((function.dim,))


def _sum(parts: Sequence[CoefficientFunction]) -> CoefficientFunction:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total
