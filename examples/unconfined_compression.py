"""Unconfined compression of a cartilage explant: swollen under a tare load, pressed by 10 % in a minute, then held.

Charge and solidity vary with depth. Prints the force at the end of the ramp, after half an hour, and at rest [N].
"""

from ngsolve import y

from ngswell import Axisymmetric, Bath, HolmesMow, Material, Platen, Ramp, Reaction, Scene, Symmetry, rectangle

cartilage = Material(
    mu=0.3,  # N/mm²
    lam=0.1,  # N/mm²
    nS0=0.28 - 0.08 * y,  # [-], from the deep side y = 0 to the surface y = 1 mm
    cfc0=0.25 - 0.15 * y,  # mol/l
    D_plus=5e-4,  # mm²/s
    D_minus=8e-4,  # mm²/s
    K=1e-3,  # mm⁴/(N s)
    permeability=HolmesMow(alpha=2.0, M=4.0),
)
walls = [Symmetry("left"), Symmetry("bottom")]  # the axis; a frictionless, sealed plate below
explant = Scene(
    mesh=rectangle(1.5, 1.0, 8, 6, grade={"right": 4.0}),  # mm
    kinematics=Axisymmetric(),
    material=cartilage,
    supports=[*walls, Platen("top", force=-0.1)],  # N, the tare load
    baths=[Bath("right", c=0.15)],  # mol/l
)
swollen = explant.equilibrate()
height = explant.state(swollen).at((0.0, 1.0), "displacement")[1]  # mm
press = Platen("top", displacement=Ramp((0, height), (60, height - 0.1)))
test = explant.after(swollen, start=0.0, supports=[*walls, press])

force = Reaction("top", when=[0.0, 60.0, 1800.0])
at_rest = Reaction("top")
if __name__ == "__main__":
    test.run(1800, observers=[force])
    test.equilibrate(1800, observers=[at_rest])
    print(f"peak {force.values[1, 1]:.3f} N, after 30 min {force.values[2, 1]:.3f} N, at rest {at_rest.values[0, 1]:.3f} N")
