"""A borehole of 200 mm in clay: its wall comes inwards; mud of less salt presses all around it, but hardly moves it."""

from ngswell import Adaptive, Bath, Cylindrical, Material, Pressure, Probe, Ramp, Scene, Traction, day, metre, ray
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium

CLAY = Material(mu=40.0, lam=60.0, nS0=0.55, cfc0=0.8, D_plus=4e-5, D_minus=5e-5, K=2e-7)
WALL, FAR, SALT = 100.0, 5 * metre, 0.5  # [mm], [mm], salt of the ground water [mol/l]
ROCK = homogeneous_equilibrium(CLAY, SALT, "confined", boundary_charge=0.8).p  # that of the undeformed clay [N/mm²]


def borehole(mud=SALT, drop=ROCK):
    """Drilled within a day: the pressure on the wall falls by `drop` [N/mm²], its salt goes to that of the `mud` [mol/l]."""
    return Scene(
        mesh=ray(WALL, FAR, 30, grade={"inner": 300}),
        kinematics=Cylindrical(),
        material=CLAY,
        baths=[Bath("inner", c=Ramp((0, SALT), (day, mud)))],
        loads=[Traction("outer", (-ROCK,)), Pressure("inner", Ramp((0, ROCK), (day, ROCK - drop)))],
        initial=(SALT, 0.0),
    )


def wall(scene, until=30 * day):
    """How far the wall comes inwards [mm], and the hoop stress in it [N/mm²], every day."""
    probe = Probe((WALL,), "displacement", "stress", when=day, dense=True)
    scene.run(until, Adaptive(1e-4), [probe])
    return -probe.values["displacement"], probe.values["stress"][:, 4]


if __name__ == "__main__":
    for mud in (SALT, 0.05):
        inwards, hoop = wall(borehole(mud))
        print(f"mud of {mud} mol/l: {inwards[-1]:.2f} mm inwards, hoop stress {hoop[-1]:.2f} N/mm² after 30 days")
