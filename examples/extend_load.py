"""A load of one's own: a pressure that stays normal to the deformed surface and follows a history."""

from dataclasses import dataclass

from ngsolve import InnerProduct

from ngswell import Load, Ramp, Role, Term


@dataclass(frozen=True)
class FollowerPressure(Load):
    """Outer pressure on the deformed boundary; −∫ q n · v da is its power."""

    boundary: str
    pressure: Ramp  # [N/mm²] over time [s]

    schedules = property(lambda self: (self.pressure,))

    def check_in(self, surroundings):
        surroundings.check_boundary("FollowerPressure", self.boundary)

    def terms(self, state, v, clock):
        power = InnerProduct(state.kinematics.area_vector(state.u), v)  # per reference area
        return [Term("momentum", "pressure", clock.follow(self.pressure) * power, role=Role.LOAD, boundary=self.boundary)]
