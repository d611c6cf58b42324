"""A load of one's own: springs to where a boundary was at first, with a stiffness that follows a history."""

from dataclasses import dataclass

from ngsolve import InnerProduct

from ngswell import Load, Ramp, Role, Term


@dataclass(frozen=True)
class Springs(Load):
    """Traction −k u per reference area."""

    boundary: str
    stiffness: Ramp  # k [N/mm³] over time [s]

    schedules = property(lambda self: (self.stiffness,))

    def check_in(self, surroundings):
        surroundings.check_boundary("Springs", self.boundary)

    def terms(self, state, v, clock):
        power = -clock.follow(self.stiffness) * InnerProduct(state.u, v)
        return [Term("momentum", "springs", -power, role=Role.LOAD, boundary=self.boundary)]
