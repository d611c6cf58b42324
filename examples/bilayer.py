"""A strip of two gels, one with more fixed charge: how it curls as it swells."""

import numpy as np

from ngswell import Bath, LocalDonnan, Material, PlaneStrain, Roller, Scene, by_region, rectangle

LENGTH, THICKNESS = 2.0, 0.1  # [mm]
BATH = 0.15  # [mol/l]


def gel(charge):
    return Material(mu=0.1, lam=0.1, nS0=0.2, cfc0=charge, D_plus=5e-4, D_minus=8e-4, K=1e-3)


def curled(upper, lower=0.05, cells=20):
    """The strip and its state of rest, for the charges of its halves [mol/l]; it is held at one end."""
    mesh = rectangle(LENGTH, THICKNESS, cells, 4, lines={"y": THICKNESS / 2}, regions={"y": ["lower", "upper"]})
    strip = Scene(
        mesh=mesh,
        kinematics=PlaneStrain(),
        material=by_region(mesh, lower=gel(lower), upper=gel(upper)),
        model=LocalDonnan(),  # exact at rest
        supports=[Roller("left", "xy")],
        baths=[Bath("top|right|bottom", c=BATH)],
    )
    return strip.state(strip.equilibrate())


def curvature(state):
    """Of the middle line, away from its ends: one over the radius of the circle through three places [1/mm]."""
    along = np.array([(share * LENGTH, THICKNESS / 2) for share in (0.25, 0.5, 0.75)])
    a, b, c = (place + state.at(place, "displacement") for place in along)
    sides = np.linalg.norm(b - a) * np.linalg.norm(c - b) * np.linalg.norm(c - a)
    return 2 * np.linalg.det([b - a, c - b]) / sides


if __name__ == "__main__":
    print(f"radius {1 / abs(curvature(curled(0.2))):.2f} mm of a strip {LENGTH:g} mm long")
