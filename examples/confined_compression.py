"""Confined compression of a cartilage explant under a porous platen: stress relaxation in four steps of 2 %.

Charge and solidity vary with depth. Prints the stress at the end of each ramp, and when it has relaxed [N/mm²].
"""

from ngsolve import x

from ngswell import Bath, Confined, HolmesMow, Material, Platen, Ramp, Reaction, Roller, Scene, column

cartilage = Material(
    mu=0.3,  # N/mm²
    lam=0.1,  # N/mm²
    nS0=0.28 - 0.08 * x,  # [-], from the deep side x = 0 to the surface x = 1 mm
    cfc0=0.25 - 0.15 * x,  # mol/l
    D_plus=5e-4,  # mm²/s
    D_minus=8e-4,  # mm²/s
    K=1e-3,  # mm⁴/(N s)
    permeability=HolmesMow(alpha=2.0, M=4.0),
)
STEP, HOLD = 100.0, 5000.0  # s
steps = [point for n in range(4) for point in ((n * HOLD, -0.02 * n), (n * HOLD + STEP, -0.02 * (n + 1)))]
explant = Scene(
    mesh=column(1.0, 20, grade={"top": 4.0}),  # mm
    kinematics=Confined(),
    material=cartilage,
    supports=[Roller("bottom", "x"), Platen("top", displacement=Ramp(*steps))],
    baths=[Bath("top", c=0.15, porous_plate=True)],  # mol/l
)


def stresses():
    """Rows of the stress at the end of a ramp, and at the end of the step [N/mm²]."""
    plate = Reaction("top", when=[time for n in range(4) for time in (n * HOLD + STEP, (n + 1) * HOLD)])
    explant.run(4 * HOLD, resume=explant.equilibrate(), observers=[plate])
    return plate.values[-8:].reshape(4, 2)


if __name__ == "__main__":
    for peak, relaxed in stresses():
        print(f"peak {peak:.4f} N/mm², relaxed {relaxed:.4f} N/mm²")
