"""Isotropic solids beside the paper's. All have the material's µ and λ as Lamé constants of small strains.

None has a pole at the compression point J = nS0: what fluid is left is kept positive by Newton's method alone.
"""

from __future__ import annotations

from dataclasses import dataclass

from ngsolve import CoefficientFunction, Trace, exp, log

from ngswell import checks
from ngswell.physics.solid import Deformation, SolidParameters


@dataclass(frozen=True)
class LogNeoHookean:
    """Neo-Hookean with the square of ln J, "neo-Hookean" of FEBio: ψ = µ/2 (tr C − 3) − µ ln J + λ/2 ln² J,
    τ = µ (B − I) + λ ln J I.

    J. Bonet and R. D. Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (1997). Bulk stiffness falls beyond
    J = e.
    """

    def energy(self, deformation: Deformation, material: SolidParameters) -> CoefficientFunction:
        ln_J = log(deformation.J)
        return material.mu / 2 * (deformation.I1 - 3) - material.mu * ln_J + material.lam / 2 * ln_J * ln_J


@dataclass(frozen=True)
class MooneyRivlin:
    """Mooney-Rivlin with ln² J for changes of volume, "Mooney-Rivlin" of FEBio. `share` is s = C₂/(C₁ + C₂), 0 to 1 [-]:

    ψ = µ/2 [(1 − s) (J^(−2/3) I₁ − 3) + s (J^(−4/3) I₂ − 3)] + (λ/2 + µ/3) ln² J, with µ/2 = C₁ + C₂.

    R. S. Rivlin, Phil. Trans. R. Soc. A 241 (1948) 379. Bulk stiffness falls beyond J = e.
    """

    share: float

    def __post_init__(self) -> None:
        checks.set_fields(self, share=checks.number("MooneyRivlin: share", self.share, "", 0.0, 1.0, "it is C₂/(C₁ + C₂)"))

    def energy(self, deformation: Deformation, material: SolidParameters) -> CoefficientFunction:
        d, m, s = deformation, material, self.share
        ln_J = log(d.J)
        shape = (1 - s) * (exp(-2 / 3 * ln_J) * d.I1 - 3) + s * (exp(-4 / 3 * ln_J) * second_invariant(d) - 3)
        return m.mu / 2 * shape + (m.lam / 2 + m.mu / 3) * ln_J * ln_J


@dataclass(frozen=True)
class HolmesMowSolid:
    """Cartilage that stiffens exponentially, `beta` ≥ 0 [-]; as β → 0 it is ψ = H Q/(4β). With H = 2µ + λ

    ψ = H/(4β) (exp Q − 1),   Q = β/H [(2µ − λ) (I₁ − 3) + λ (I₂ − 3) − 2 H ln J].

    M. H. Holmes and V. C. Mow, J. Biomech. 23 (1990) 1145, in the form of FEBio's "Holmes-Mow".
    """

    beta: float

    def __post_init__(self) -> None:
        checks.set_fields(self, beta=checks.number("HolmesMowSolid: beta", self.beta, "", 0.0, 100.0))

    def energy(self, deformation: Deformation, material: SolidParameters) -> CoefficientFunction:
        d, mu, lam = deformation, material.mu, material.lam
        H = 2 * mu + lam
        per_beta = ((2 * mu - lam) * (d.I1 - 3) + lam * (second_invariant(d) - 3)) / H - 2 * log(d.J)
        if self.beta == 0:
            return H / 4 * per_beta
        return H / (4 * self.beta) * (exp(self.beta * per_beta) - 1)


def second_invariant(deformation: Deformation) -> CoefficientFunction:
    """I₂ = (tr² C − tr C²)/2 [-]."""
    C = deformation.F.trans * deformation.F
    return (deformation.I1 * deformation.I1 - Trace(C * C)) / 2
