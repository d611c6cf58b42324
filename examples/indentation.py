"""A porous ball pressed into a layer of cartilage on bone: the force at once and after an hour."""

from ngswell import Adaptive, Axisymmetric, Bath, Material, Obstacle, Ramp, Reaction, RigidSphere, Roller, Scene, rectangle

CARTILAGE = Material(mu=0.15, lam=0.1, nS0=0.2, cfc0=0.1, D_plus=5e-4, D_minus=8e-4, K=2e-3)
WIDTH, THICKNESS, BALL, DEPTH = 4.0, 1.0, 2.0, 0.1  # [mm]
DOWN = Ramp((0, 0.0), (1, -DEPTH))  # [mm] over [s]


def indentation(cells=10):
    """Force on the ball [N] over time [s]; the layer starts at rest in 0.15 mol/l, where the ball just touches it."""
    layer = Scene(
        mesh=rectangle(WIDTH, THICKNESS, cells, cells, grade={"top": 8, "left": 8}),
        kinematics=Axisymmetric(),
        material=CARTILAGE,
        supports=[Roller("left", "r"), Roller("bottom", "rz")],
        baths=[Bath("top|right", c=0.15)],
    )
    rest = layer.equilibrate()
    top = THICKNESS + layer.state(rest).at((0.0, THICKNESS), "displacement")[1]
    ball = Obstacle("top", RigidSphere((0.0, top + BALL), BALL), (0.0, DOWN))
    force = Reaction("top")
    layer.after(rest, loads=[ball]).run(until=3600.0, steps=Adaptive(1e-3), observers=[force])
    return force.time, force.values[:, 1]


if __name__ == "__main__":
    time, force = indentation()
    print(f"{1e3 * force.max():.1f} mN at {time[force.argmax()]:.3g} s, {1e3 * force[-1]:.1f} mN after an hour")
