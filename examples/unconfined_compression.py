"""Unconfined compression of a cartilage explant: swollen under a tare load, pressed by 10 % in a minute, then held.

Charge, solidity and fibres vary with depth. Prints the force at the end of the ramp, after half an hour, and at rest [N].
"""

from ngsolve import y

import ngswell as ng

lying, standing = 2.0 * y, 2.0 * (1 - y)  # N/mm²: in the surface, and on the bone
fibres = [ng.Fibres((1, 0, 0), lying), ng.Fibres((0, 0, 1), lying), ng.Fibres((0, 1, 0), standing)]  # r, z, hoop
cartilage = ng.Material(
    mu=0.3,  # N/mm²
    lam=0.1,  # N/mm²
    nS0=0.28 - 0.08 * y,  # [-], from the deep side y = 0 to the surface y = 1 mm
    cfc0=0.25 - 0.15 * y,  # mol/l
    D_plus=5e-4,  # mm²/s
    D_minus=8e-4,  # mm²/s
    K=1e-3,  # mm⁴/(N s)
    permeability=ng.HolmesMow(alpha=2.0, M=4.0),
    solid=ng.FibreReinforced(ng.NeoHookean(), fibres),
)
walls = [ng.Symmetry("left"), ng.Symmetry("bottom")]  # the axis; a frictionless, sealed plate below
explant = ng.Scene(
    mesh=ng.rectangle(1.5, 1.0, 8, 6, grade={"right": 4.0}),  # mm
    kinematics=ng.Axisymmetric(),
    material=cartilage,
    supports=[*walls, ng.Platen("top", force=-0.1)],  # N, the tare load
    baths=[ng.Bath("right", c=0.15)],  # mol/l
)
swollen = explant.equilibrate()
height = explant.state(swollen).at((0.0, 1.0), "displacement")[1]  # mm
press = ng.Platen("top", displacement=ng.Ramp((0, height), (60, height - 0.1)))
test = explant.after(swollen, start=0.0, supports=[*walls, press])

force, at_rest = ng.Reaction("top", when=[0.0, 60.0, 1800.0]), ng.Reaction("top")
if __name__ == "__main__":
    test.run(1800, observers=[force])
    test.equilibrate(1800, observers=[at_rest])
    print(f"peak {force.values[1, 1]:.3f} N, after 30 min {force.values[2, 1]:.3f} N, at rest {at_rest.values[0, 1]:.3f} N")
