"""A solid law of one's own: neo-Hookean with µ ln J and λ/2 ln² J, in place of the paper's (18)."""

from dataclasses import dataclass

from ngsolve import log


@dataclass(frozen=True)
class LogNeoHookean:
    """ψ = µ/2 tr C − µ ln J + λ/2 ln² J [N/mm²]."""

    def energy(self, deformation, material):
        d, m = deformation, material  # d has F (3 × 3), J, content = J − nS0 and I1 = tr C
        return m.mu / 2 * d.I1 - m.mu * log(d.J) + m.lam / 2 * log(d.J) ** 2
