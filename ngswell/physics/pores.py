"""Laws of the pores: permeability over deformation, diffusivity over porosity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ngsolve import exp

from ngswell import checks
from ngswell.checks import Field
from ngswell.physics.ranges import within


class Permeability(Protocol):
    """K(J) from the parameter K = K0 [mm⁴/(N s)], J and nS0 [-]. A law of one's own is a callable (a frozen dataclass or a
    function) that

    1. takes numbers and fields;
    2. gives K0 at J = 1: a material refuses it otherwise.
    """

    def __call__(self, K0: Field, J: Field, nS0: Field, /) -> Field: ...


class Diffusivity(Protocol):
    """D in the pore fluid from the parameter D0 [mm²/s] and the porosity nF [-]. A law of one's own is a callable that

    1. takes numbers and fields;
    2. is positive: a material refuses it otherwise.
    """

    def __call__(self, D0: Field, nF: Field, /) -> Field: ...


@dataclass(frozen=True)
class Constant:
    """K = K0 or D = D0 whatever the deformation, as in the paper."""

    def __call__(self, value: Field, *state: Field) -> Field:
        return value


@dataclass(frozen=True)
class PowerLaw:
    """Permeability K = K0 [(J − nS0)/(1 − nS0)]^m, m ≥ 0 [-]; K → 0 at the compression point for m > 0.

    The bracket is the void ratio nF/nS over its initial value, as in B. Markert, Transp. Porous Media 70 (2007) 427. The
    power of the porosity nF/nF0 after G. Eipper (dissertation, Stuttgart 1998) lacks the factor J^m of this one.
    """

    m: float

    def __post_init__(self) -> None:
        checks.set_fields(self, m=within("m", self.m))

    def __call__(self, K0: Field, J: Field, nS0: Field) -> Field:
        return K0 * void_ratio(J, nS0) ** self.m


@dataclass(frozen=True)
class HolmesMow:
    """Permeability K = K0 [(J − nS0)/(1 − nS0)]^α exp[M (J² − 1)/2], α ≥ 0, M ≥ 0 [-].

    M. H. Holmes and V. C. Mow, J. Biomech. 23 (1990) 1145, for cartilage.
    """

    alpha: float
    M: float

    def __post_init__(self) -> None:
        checks.set_fields(self, alpha=within("alpha", self.alpha), M=within("M", self.M))

    def __call__(self, K0: Field, J: Field, nS0: Field) -> Field:
        return K0 * void_ratio(J, nS0) ** self.alpha * exp(self.M / 2 * (J * J - 1))


@dataclass(frozen=True)
class MackieMeares:
    """Diffusivity D = D0 [nF/(2 − nF)]²: the solid's chains lengthen the ions' paths.

    D_plus and D_minus are then those of the free solution, D0. J. S. Mackie and P. Meares, Proc. R. Soc. A 232 (1955) 498.
    """

    def __call__(self, D0: Field, nF: Field) -> Field:
        obstruction = nF / (2 - nF)
        return D0 * (obstruction * obstruction)


def void_ratio(J: Field, nS0: Field) -> Field:
    """nF/nS over its initial value, (J − nS0)/(1 − nS0) [-]; zero at the compression point."""
    return (J - nS0) / (1 - nS0)
