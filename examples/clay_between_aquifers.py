"""Clay of two layers, 40 m, between aquifers: the upper turns from sea to fresh water; salt after 1e6 years."""

from ngswell import Adaptive, Bath, Confined, Material, Probe, Ramp, Roller, Scene, by_region, column, metre, year

HEIGHT, SEA, FRESH = 40 * metre, 0.5, 0.02  # [mm], [mol/l]
STIFF = Material(mu=200.0, lam=300.0, nS0=0.7, cfc0=0.2, D_plus=1.5e-5, D_minus=2e-5, K=1e-7)
SWELLING = Material(mu=40.0, lam=60.0, nS0=0.55, cfc0=0.8, D_plus=4e-5, D_minus=5e-5, K=2e-7)


def scene(lower=STIFF, upper=SWELLING):
    """The clay starts undeformed, under the pressure that its charge has in sea water."""
    mesh = column(HEIGHT, 24, grade={"top": 6}, lines={"x": 25 * metre}, regions={"x": ["lower", "upper"]})
    return Scene(
        mesh=mesh,
        kinematics=Confined(),
        material=by_region(mesh, lower=lower, upper=upper),
        supports=[Roller("bottom", "x")],
        baths=[Bath("top", c=Ramp((0, SEA), (1000 * year, FRESH))), Bath("bottom", c=SEA)],
        initial=(SEA, 0.0),
    )


def history(clay, until=1e6 * year):
    """Anions [mol/l] in the middle of the upper layer and heave of the top [mm], every 1e4 years."""
    middle = Probe((32.5 * metre,), "c_minus", when=1e4 * year, dense=True)
    top = Probe((HEIGHT,), "displacement", when=1e4 * year, dense=True)
    clay.run(until, Adaptive(1e-4), [middle, top], resume=clay.equilibrate())
    return middle.time / year, middle.values["c_minus"], top.values["displacement"]


if __name__ == "__main__":
    years, anions, heave = history(scene())
    for at in (0, 10, -1):
        print(f"{years[at]:8.0f} a: anions {anions[at]:.3f} mol/l, heave {heave[at] - heave[0]:.0f} mm")
