"""A gel disc that is moved from its bath into a beaker of little water: the salt that it brings along ends its swelling.

Prints the concentration of the water [mol/l] and the fluid in the disc [mm³] over five hours.
"""

from ngswell import TABLE_1, Axisymmetric, Bath, Ledger, Roller, Scene, Vessel, hour, rectangle

BOUNDARY = "top|right"
bath = Scene(
    mesh=rectangle(2.0, 0.5, 8, 4, grade={"top": 5, "right": 5}),  # radius, half of the height [mm]; cells
    kinematics=Axisymmetric(),
    material=TABLE_1,
    supports=[Roller("left", "r"), Roller("bottom", "z")],
    baths=[Bath(BOUNDARY, c=0.15)],  # mol/l
)


def beaker(volume):
    """The swollen disc in so much water [mm³], nearly pure, from time zero; the upper half of both."""
    water = Bath(BOUNDARY, c=1e-3, vessel=Vessel(volume / 2))
    return bath.after(bath.equilibrate(), start=0.0, baths=[water])


def course(volume=20.0):
    """Time [s], concentration of the water [mol/l] and fluid in the disc [mm³]."""
    ledger = Ledger()
    beaker(volume).run(until=5 * hour, observers=[ledger])
    return ledger.time, ledger.bath_c[BOUNDARY], 2 * ledger.fluid


if __name__ == "__main__":
    for time, c, fluid in zip(*course(), strict=True):
        print(f"{time:8.1f} s   {c:.4f} mol/l   {fluid:.3f} mm³")
