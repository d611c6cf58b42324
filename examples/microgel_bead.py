"""A microgel bead, 100 µm across, whose bath is diluted within a millisecond: how large it gets, and how fast."""

from ngswell import Adaptive, Bath, Material, Probe, Ramp, Scene, Spherical, Symmetry, micrometre, ray

GEL = Material(mu=0.02, lam=0.01, nS0=0.1, cfc0=0.1, D_plus=1.3e-3, D_minus=2e-3, K=1e-2)
BEFORE, AFTER = 0.15, 0.015  # [mol/l]


def swelling(radius=50 * micrometre):
    """Radius [mm] over time [s], from rest in the bath before to rest in that after."""
    pace = (radius / (50 * micrometre)) ** 2  # fluid and salt take the square of the way
    bead = Scene(
        mesh=ray(0.0, radius, 16, grade={"outer": 10}),
        kinematics=Spherical(),
        material=GEL,
        supports=[Symmetry("inner")],
        baths=[Bath("outer", c=Ramp((0, BEFORE), (1e-3 * pace, AFTER)))],
    )
    surface = Probe((radius,), "displacement", when=0.05 * pace, dense=True)
    bead.run(until=20.0 * pace, steps=Adaptive(1e-4), observers=[surface], resume=bead.equilibrate())
    return surface.time, radius + surface.values["displacement"]


def half_time(time, radius):
    """When half of the swelling is done [s]."""
    return time[(radius - radius[0] < (radius[-1] - radius[0]) / 2).sum()]


if __name__ == "__main__":
    time, radius = swelling()
    print(f"{1e3 * radius[0]:.1f} to {1e3 * radius[-1]:.1f} µm, half of it within {half_time(time, radius):.2g} s")
