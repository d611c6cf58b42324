"""Oedometer: the swelling pressure of a charged gel that is kept at its height, against the salinity of its bath.

Prints concentration [mol/l] and pressure on the porous plate [N/mm²]. At the height at which it is free of stress without
charge, the gel's pressure is Donnan's: 2 Rθ (sqrt(c̄² + cfc²/4) − c̄).
"""

from ngswell import Bath, Confined, Material, Platen, Ramp, Reaction, Roller, Scene, column

gel = Material(
    mu=0.24,  # N/mm²
    lam=0.02,  # N/mm²
    nS0=0.25,
    cfc0=0.2,  # mol/l
    D_plus=5e-4,  # mm²/s
    D_minus=8e-4,  # mm²/s
    K=1e-3,  # mm⁴/(N s)
)


def swelling_pressure(salt, displacement=0.0):
    """Pressure on the plate [N/mm²] at rest with `salt` [mol/l]; `displacement` [mm] of the plate from 10 mm of height."""
    plate = Reaction("top")
    cell = Scene(
        mesh=column(10.0, 10),  # mm
        kinematics=Confined(),
        material=gel,
        supports=[Roller("bottom", "x"), Platen("top", displacement=Ramp((0, 0.0), (1, displacement)))],
        baths=[Bath("top", c=salt, porous_plate=True)],
    )
    cell.equilibrate(1.0, observers=[plate])
    return plate.values[0, 0]


if __name__ == "__main__":
    for salt in (1.0, 0.3, 0.1, 0.03, 0.01):
        kept, pressed = swelling_pressure(salt), swelling_pressure(salt, -1.0)
        print(f"{salt:5.2f} mol/l   {kept:.4f} N/mm²   pressed by a tenth {pressed:.4f} N/mm²")
