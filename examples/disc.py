"""An intervertebral disc: a soft, charged nucleus in an annulus with crossed fibres, at rest at night and pressed by day."""

from math import cos, pi, sin

import ngswell as ng

HALF_HEIGHT = 5.0  # mm
mesh = ng.rectangle(
    20.0, HALF_HEIGHT, 10, 5, grade={"top": 3, "right": 3}, lines={"x": 12.0}, regions={"x": ["nucleus", "annulus"]}
)

# Lamellae of the annulus: fibres at 30° to the plane of the disc, to both sides. Components are r, z, hoop.
xi = ng.by_region(mesh, nucleus=0.0, annulus=3.0)  # N/mm²
families = [ng.Fibres((0, side * sin(pi / 6), cos(pi / 6)), xi, alpha=5.0) for side in (1, -1)]
solid = ng.FibreReinforced(ng.NeoHookean(), families)
common = {"lam": 0.02, "D_plus": 5e-4, "D_minus": 8e-4, "K": 2e-4, "solid": solid}
material = ng.by_region(
    mesh,
    nucleus=ng.Material(mu=0.03, nS0=0.15, cfc0=0.25, **common),
    annulus=ng.Material(mu=0.15, nS0=0.25, cfc0=0.12, **common),
)

# The half above the middle plane. The vertebra's endplate sticks to it, lets fluid through, and pushes, with N.
endplate = ng.Platen("top", force=ng.Ramp((0, -150.0), (60, -350.0)), glued=True)
disc = ng.Scene(
    mesh=mesh,
    kinematics=ng.Axisymmetric(),
    material=material,
    supports=[ng.Roller("left", "r"), ng.Roller("bottom", "z"), endplate],
    baths=[ng.Bath("top|right", c=0.15)],
)

if __name__ == "__main__":
    night = disc.equilibrate(0.0)
    day = disc.run(16 * ng.hour, ng.Adaptive(2e-2), resume=night)
    for name, state in (("night", disc.state(night)), ("day", day.state)):
        height = 2 * (HALF_HEIGHT + state.at((1.0, 4.999), "displacement")[1])
        print(f"{name}: {state.at((1.0, 0.5), 'p'):.3f} N/mm² in the nucleus, {height:.2f} mm high")
