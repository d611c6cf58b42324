"""Fig. 4: does it matter that the charge at the boundary follows the deformation?

A column of Table 1 in equilibrium with 0.15 mol/l; the bath on top falls to 0.125 mol/l within 10 s. Once the bath's Donnan
condition follows cfc(J) at the boundary, once the charge there stays at cfc0. Numbers, in mm:

- `following_final_mm`, `frozen_final_mm`: top displacement at rest;
- `closed_form_following_mm`, `closed_form_frozen_mm`: the same from equilibrium of a homogeneous confined column;
- `following_error`, `frozen_error`: relative difference of the two.
"""

from __future__ import annotations

import matplotlib.pyplot as plt

from ngswell import (
    BACKWARD_EULER,
    TABLE_1,
    Adaptive,
    Bath,
    Concentration,
    Confined,
    Frozen,
    Penalty,
    Probe,
    Progress,
    Ramp,
    Roller,
    Scene,
    Traction,
    column,
)
from ngswell.baths.bath import Treatment
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.physics import donnan
from studies.output import Findings, cost

HEIGHT = 0.5  # mm
BATH = Ramp((0, 0.15), (10, 0.125))  # s, mol/l
AT_REST = 6000.0  # s, some thirty times the slowest relaxation time
P0 = donnan.pressure(0.15, TABLE_1.cfc0, TABLE_1.RT)  # N/mm², holds the charged, stress-free reference state


def scene(treatment: Treatment, cells: int) -> Scene:
    """The column: held at the bottom, bath and equilibrium load on top."""
    return Scene(
        mesh=column(HEIGHT, cells),
        kinematics=Confined(),
        material=TABLE_1,
        model=Concentration(),
        supports=[Roller("bottom", "x")],
        baths=[Bath("top", c=BATH, treatment=treatment)],
        loads=[Traction("top", (-P0,))],
    )


def run(quick: bool = False) -> Findings:
    """Both columns, side by side."""
    cells, tolerance = (30, 1e-3) if quick else (60, 1e-4)
    cases: dict[str, Treatment] = {"following": Penalty(1.0), "frozen": Frozen()}
    probes, results = {}, {}
    for name, treatment in cases.items():
        probes[name] = Probe((HEIGHT,), "displacement")
        progress = Progress(f"boundary_charge {name}")
        results[name] = scene(treatment, cells).run(
            AT_REST, Adaptive(tolerance, scheme=BACKWARD_EULER), [probes[name], progress]
        )

    boundary_charges = {"following": None, "frozen": TABLE_1.cfc0}
    numbers: dict[str, float | int | str] = {}
    closed = {}
    for name, charge in boundary_charges.items():
        rest = homogeneous_equilibrium(TABLE_1, BATH.values[-1], "confined", load=P0, boundary_charge=charge)
        closed[name] = HEIGHT * (rest.J - 1)
        final = float(probes[name].values["displacement"][-1].item())
        numbers |= {f"{name}_final_mm": final, f"closed_form_{name}_mm": closed[name]}
        numbers[f"{name}_error"] = abs(final / closed[name] - 1)
    numbers |= {"mesh": f"{cells} segments, order 2", **cost(list(results.values()))}

    figure, axes = plt.subplots(figsize=(5.2, 3.4))
    labels = {"following": "charge at the boundary follows J", "frozen": "charge at the boundary frozen at $c^{fc}_0$"}
    for (name, probe), style in zip(probes.items(), ("-", "--"), strict=True):
        axes.plot(probe.time, probe.values["displacement"], "k" + style, label=labels[name])
        axes.axhline(closed[name], color="0.55", lw=0.8, ls=":")
    axes.annotate("closed forms", (1480, closed["frozen"]), (0, -4), textcoords="offset points",
                  ha="right", va="top", fontsize=8, color="0.35")  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="displacement of the top [mm]", xlim=(0, 1500), ylim=(0, None))
    axes.legend(loc="lower right")
    rows = [
        (name, float(time), float(value.item()))
        for name, probe in probes.items()
        for time, value in zip(probe.time, probe.values["displacement"], strict=True)
    ]
    return Findings(figure, ("boundary_charge", "time_s", "top_displacement_mm"), rows, numbers)
