"""Terms over the body as coefficients of operators on test and trial functions, by NGSolve's symbolic differentiation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from netgen.meshing import NgException
from ngsolve import CF, CacheCF, CoefficientFunction, GridFunction, InnerProduct, dx, grad

from ngswell.models.term import Kind, Term


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

        residual Σ_k R_k(W) · T_k,    tangent Σ_kl T_k · D_kl W_l,   D_kl = ∂R_k/∂W_l at the fields.

    Each R_k is compiled as a whole, and all D_kl together: they are evaluated once a cell. By itself a form evaluates
    the whole integrand for each component of a test function and, for the tangent, of a trial function.

    Raises NotDerivable.
    """

    def __init__(self, unknowns: Unknowns, terms: Sequence[Term], weight: Any, rates: Any = None) -> None:
        try:
            total = _sum([_integrand(unknowns, term, weight, rates) for term in terms])
            total, tests = _unified(total, unknowns.tests, trial=False)
            total, trials = _unified(total, unknowns.trials, trial=True)
            self._tests, self._trials = ([operator.function for operator in operators] for operators in (tests, trials))
            self._rows = [_flat(total.Diff(test)) for test in self._tests]
            # Powers of a GridFunction cannot be differentiated by it, those of a multiple can.
            at = [(1.0 * operator.on(unknowns.fields.components)).MakeVariable() for operator in trials]
            at_fields = total.Replace(dict(zip(self._trials, at, strict=True)))
            rows = CF(tuple(_flat(at_fields.Diff(test)) for test in self._tests))
            self._columns = [rows.Diff(variable).Reshape((rows.dim, variable.dim)) for variable in at]
        except NgException as refused:
            raise NotDerivable(str(refused)) from refused

    @property
    def residual(self) -> CoefficientFunction:
        """Σ R_k(W) · T_k."""
        return _sum([_dot(row.Compile().Freeze(), test) for row, test in zip(self._rows, self._tests, strict=True)])

    @property
    def tangent(self) -> CoefficientFunction:
        """Σ T_k · D_kl W_l."""
        blocks, start = {}, 0
        for k, row in enumerate(self._rows):
            present = {id(trial) for trial in (InnerProduct(row, row) * dx).GetProxies(True)}
            for col, (trial, column) in enumerate(zip(self._trials, self._columns, strict=True)):
                if id(trial) in present:
                    blocks[k, col] = column[start : start + row.dim, 0 : trial.dim]
            start += row.dim
        return _bilinear(blocks, self._tests, self._trials)


def _bilinear(
    blocks: dict[tuple[int, int], CoefficientFunction],
    tests: Sequence[CoefficientFunction],
    trials: Sequence[CoefficientFunction],
) -> CoefficientFunction:
    """Σ T_k · D_kl W_l, all blocks D_kl compiled together and evaluated once a cell."""
    values = CacheCF(CF(tuple(_flat(block) for block in blocks.values())).Compile()).Freeze()
    parts, start = [], 0
    for k, col in blocks:
        rows, columns = tests[k].dim, trials[col].dim
        mine = values[start : start + rows * columns]
        start += rows * columns
        if rows == 1:
            parts.append(_dot(mine, trials[col]) * tests[k])
        elif columns == 1:
            parts.append(_dot(mine, tests[k]) * trials[col])
        else:
            parts.append(InnerProduct(mine.Reshape((rows, columns)) * _flat(trials[col]), _flat(tests[k])))
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
    return InnerProduct(values, _flat(operator)) if operator.dim > 1 else values[0] * operator


def _flat(function: CoefficientFunction) -> CoefficientFunction:
    """Its components as a vector, those of a scalar as well."""
    return function.Reshape((function.dim,))


def _sum(parts: Sequence[CoefficientFunction]) -> CoefficientFunction:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total
