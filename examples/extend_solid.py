"""A solid law of one's own: neo-Hookean with a volumetric part that grows as J², in place of the paper's (18)."""

from dataclasses import dataclass

from ngsolve import log


@dataclass(frozen=True)
class SquareNeoHookean:
    """ψ = µ/2 tr C − µ ln J + λ/4 (J² − 1 − 2 ln J) [N/mm²]."""

    def energy(self, deformation, material):
        d, m = deformation, material  # d has F (3 × 3), J, content = J − nS0 and I1 = tr C
        return m.mu / 2 * d.I1 - m.mu * log(d.J) + m.lam / 4 * (d.J**2 - 1 - 2 * log(d.J))
