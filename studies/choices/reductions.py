"""Which model does a scene need? `LocalDonnan` and `Uncharged` against the full model `Concentration`.

A confined column of Table 1 at rest in 0.15 mol/l is disturbed in three ways: a sudden load on top, a sudden change of the
bath, and the same change within one swelling time. The ratio H K / D of the time in which salt diffuses (height²/D) to the
time in which the drained solid swells (height²/(H K)) goes over four decades, with K fixed and D₊/D₋ kept; H = 2µ + λ is the
drained modulus, D = 2 D₊ D₋/(D₊ + D₋) the salt's diffusivity; Table 1 has 0.87. Then, at a ratio of 1, the charge, the load
and the bath's step vary. All models take the same steps. The error of a model is the largest difference of its top
displacement to the full model's at any time, relative to the full model's final displacement. It is 1 for a model in which
nothing moves.

`Uncharged` is run as it stands (no charge, drained modulus and permeability of Table 1) and with effective parameters
(`effective`): what `LocalDonnan` becomes for small strains. Numbers, M being local_donnan, uncharged or effective:

- `M_error_load_R`, `M_error_bath_step_R`, `M_error_bath_ramp_R`: errors [-] at the ratio R, 0.01 to 100;
- `M_error_load_cfc0_C`, `M_error_bath_step_cfc0_C`: errors at a fixed charge of C mol/l;
- `M_error_load_S_H`: errors under a load of S times H;
- `M_error_bath_to_C`: errors when the bath goes to C mol/l;
- `local_donnan_order_bath_ramp`, `local_donnan_order_load`: slope of the error over the smallest decade of the ratio [-];
- `mesh_change`, `step_change`: relative change of `local_donnan_error_bath_step_1` with twice the cells, twice the steps;
- `N_column_unknowns`, `N_column_iterations`, `N_column_seconds`, N being full, local_donnan or uncharged: unknowns, and
  medians over the loads of the first family of the Newton iterations and of the loop's seconds; `M_column_..._ratio`: the
  same over the full model's;
- `N_block_...`, `M_block_..._ratio`: the same for a plane-strain block, where assembling and factorising cost most.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tqdm import tqdm

from ngswell import (
    TABLE_1,
    Bath,
    Concentration,
    Fixed,
    LocalDonnan,
    Material,
    Penalty,
    PlaneStrain,
    Probe,
    Ramp,
    Result,
    Roller,
    Scene,
    Traction,
    Uncharged,
    rectangle,
)
from ngswell.models.model import Model
from ngswell.physics import donnan
from studies.output import Findings, cost, letter_panels
from studies.scenes import BATH, COLUMN_HEIGHT, confined_column, rest_load

CHARGE = float(TABLE_1.cfc0)  # mol/l
H = 2 * float(TABLE_1.mu) + float(TABLE_1.lam)  # N/mm², drained modulus of the confined column
SWELLING_TIME = COLUMN_HEIGHT**2 / (H * float(TABLE_1.K))  # s
WEAK = Penalty(relative=1e4)  # for all models: the same resistance at the bath, too small to be seen

MODELS: dict[str, Model] = {
    "full": Concentration(),
    "local_donnan": LocalDonnan(),
    "uncharged": Uncharged(),
    "effective": Uncharged(),
}
CHARGED = ("full", "local_donnan")
RATIOS = (0.01, 0.1, 1.0, 10.0, 100.0)
BETWEEN = (0.0316, 0.316, 3.16, 31.6)  # for the figure
CHARGES = (0.02, 0.05, 0.1, 0.2, 0.4)  # mol/l
LOADS = (0.01, 0.1, 0.4)  # of H
BATHS = (0.14, 0.125, 0.1, 0.05)  # mol/l


@dataclass(frozen=True)
class Disturbance:
    """What disturbs a column of the family, the column's ratio H K / D and its charge cfc0 [mol/l]."""

    kind: str
    ratio: float = 1.0
    cfc0: float = CHARGE
    load: float = 0.0  # N/mm², on top from the start
    bath: Ramp = Ramp((0, BATH))  # s, mol/l; what it differs by from BATH at the start is a sudden step

    @property
    def material(self) -> Material:
        """Table 1 with the case's charge and diffusivities."""
        D_plus, D_minus = TABLE_1.number("D_plus"), TABLE_1.number("D_minus")
        D = 2 * D_plus * D_minus / (D_plus + D_minus)
        factor = H * float(TABLE_1.K) / (self.ratio * D)
        return replace(TABLE_1, cfc0=self.cfc0, D_plus=factor * D_plus, D_minus=factor * D_minus)

    def times(self, steps: int) -> NDArray:
        """Ends of the steps [s], geometric from a ten-thousandth of the swelling time to well after the slower process."""
        end = 20 * max(1.0, self.ratio) * SWELLING_TIME
        return np.unique([*np.geomspace(1e-4 * SWELLING_TIME, end, steps), SWELLING_TIME])


def load(share: float = 0.1, ratio: float = 1.0, cfc0: float = CHARGE) -> Disturbance:
    """A sudden load of `share` times the drained modulus."""
    return Disturbance("load", ratio, cfc0, load=share * H)


def bath_step(to: float = 0.125, ratio: float = 1.0, cfc0: float = CHARGE) -> Disturbance:
    """The bath at another concentration [mol/l] from the start."""
    return Disturbance("bath_step", ratio, cfc0, bath=Ramp((0, to)))


def bath_ramp(ratio: float = 1.0) -> Disturbance:
    """The bath falls within one swelling time."""
    return Disturbance("bath_ramp", ratio, bath=Ramp((0, BATH), (SWELLING_TIME, 0.125)))


DISTURBANCES: dict[str, Callable[..., Disturbance]] = {"load": load, "bath_step": bath_step, "bath_ramp": bath_ramp}


def effective(material: Material, bath: float) -> Material:
    """The uncharged material that behaves like the charged one in `bath` [mol/l] at small strains.

    Linearised at J = 1, the osmotic pressure (38) adds −dp_D/dJ to λ, and local Donnan equilibrium divides K by
    1 + K Rθ cfc0² / [nF (D₊ c₊ + D₋ c₋)], the drag of `LocalDonnan`.
    """
    m, cfc0, nS0 = material, float(material.cfc0), float(material.nS0)
    osmotic = m.RT * cfc0**2 / (2 * (bath**2 + cfc0**2 / 4) ** 0.5 * (1 - nS0))
    conductance = m.D_plus * donnan.cations(bath, cfc0) + m.D_minus * donnan.anions(bath, cfc0)
    drag = m.K * m.RT * cfc0**2 / ((1 - nS0) * conductance)
    return replace(m, cfc0=0.0, lam=m.lam + osmotic, K=m.K / (1 + drag))


def scene(case: Disturbance, name: str, cells: int) -> Scene:
    """The column in the model `name`. Uncharged, it needs no load to be at rest in its reference configuration."""
    charged = name in CHARGED
    material = effective(case.material, BATH) if name == "effective" else case.material
    p0 = rest_load(material) if charged else 0.0
    return confined_column(
        WEAK,
        case.bath if charged else None,
        cells,
        material=material if charged else replace(material, cfc0=0.0),
        model=MODELS[name],
        loads=[Traction("top", (-p0 - case.load,))],
        initial=(BATH if charged else None, 0.0),
    )


@dataclass(frozen=True)
class ModelAnswer:
    """One case in one model: top displacement [mm] at the case's times, and the run."""

    case: Disturbance
    model: str
    top: NDArray
    result: Result


def answer(case: Disturbance, name: str, cells: int, steps: int) -> ModelAnswer:
    """Run one case in one model. One step is cut to the times of the probe: all models take the same steps."""
    times = case.times(steps)
    probe = Probe((COLUMN_HEIGHT,), "displacement", when=[0.0, *times])
    result = scene(case, name, cells).run(times[-1], Fixed(float(times[-1])), [probe])
    return ModelAnswer(case, name, probe.values["displacement"], result)


def compare(case: Disturbance, cells: int, steps: int) -> tuple[list[ModelAnswer], dict[str, float]]:
    """One case in all models (effective parameters can change the answer to a load only), and their errors."""
    runs = [answer(case, name, cells, steps) for name in MODELS if case.load or name != "effective"]
    full = runs[0].top
    return runs, {run.model: float(np.abs(run.top - full).max() / abs(full[-1])) for run in runs[1:]}


def block(name: str, cells: int) -> Result:
    """Run of a plane-strain block that is loaded and, where the model knows it, charged: ten steps of 2000 s.

    Charge that comes faster than salt diffuses in, within L²/D₊ = 2000 s, would use up the anions.
    """
    charged = name in CHARGED
    built = Scene(
        mesh=rectangle(1.0, 1.0, cells, cells),
        kinematics=PlaneStrain(),
        material=TABLE_1 if charged else replace(TABLE_1, cfc0=0.0),
        model=MODELS[name],
        supports=[Roller("bottom", "y"), Roller("left", "x")],
        baths=[Bath("right", c=BATH if charged else None, treatment=WEAK)],
        loads=[Traction("top", (0.0, -0.1 * H))],
        charge=Ramp((0, 0.0), (2e4, 1.0)),
    )
    return built.run(2e4, Fixed(2000.0))


def unknowns(result: Result) -> int:
    """Number of unknowns of a run."""
    return result.end.values.size


def costs(label: str, runs: dict[str, list[Result]]) -> dict[str, float | int | str]:
    """Unknowns, medians of iterations and seconds of each model, and their ratios to the full model's."""
    medians = {
        name: {
            "unknowns": unknowns(each[0]),
            "iterations": median(result.iterations for result in each),
            "seconds": median(result.seconds for result in each),
        }
        for name, each in runs.items()
    }
    numbers: dict[str, float | int | str] = {}
    for name, values in medians.items():
        numbers |= {f"{name}_{label}_{what}": value for what, value in values.items()}
        if name != "full":
            numbers |= {f"{name}_{label}_{what}_ratio": value / medians["full"][what] for what, value in values.items()}
    return numbers


@dataclass(frozen=True)
class Comparison:
    """Every disturbance in all models with the models' errors; a finer mesh, finer steps; blocks of each timed model."""

    ratios: tuple[float, ...]
    found: dict[str, tuple[list[ModelAnswer], dict[str, float]]]
    finer: dict[str, tuple[list[ModelAnswer], dict[str, float]]]
    blocks: dict[str, list[Result]]

    @property
    def errors(self) -> dict[str, dict[str, float]]:
        return {key: error for key, (_, error) in self.found.items()}


TIMED = tuple(name for name in MODELS if name != "effective")


def run(quick: bool = False) -> Findings:
    """All cases in all models."""
    cells, steps, block_cells, repeats = (20, 40, 8, 2) if quick else (40, 80, 16, 5)
    comparison = compute(RATIOS if quick else tuple(sorted(RATIOS + BETWEEN)), cells, steps, block_cells, repeats)
    found = numbers(comparison)
    found["mesh"] = f"{cells} segments; {block_cells} x {block_cells} quadrilaterals; order 2"
    runs = [run for each, _ in [*comparison.found.values(), *comparison.finer.values()] for run in each]
    found |= cost([r.result for r in runs] + [r for b in comparison.blocks.values() for r in b])
    header = ("case", "disturbance", "model", "ratio", "cfc0_mol_l", "load_N_mm2", "bath_end_mol_l", "error",
              "final_displacement_mm", "unknowns", "newton_iterations", "seconds")  # fmt: skip
    rows = [
        (key, r.case.kind, r.model, r.case.ratio, r.case.cfc0, r.case.load, r.case.bath.values[-1],
         error.get(r.model, 0.0), float(r.top[-1]), unknowns(r.result), r.result.iterations, r.result.seconds)
        for key, (each, error) in comparison.found.items()
        for r in each
    ]  # fmt: skip
    return Findings(draw(comparison), header, rows, found)


def disturbances(ratios: Sequence[float]) -> dict[str, Disturbance]:
    """All that are run, by their keys."""
    cases: dict[str, Disturbance] = {}
    for name, disturb in DISTURBANCES.items():
        cases |= {f"{name}_{ratio:g}": disturb(ratio=ratio) for ratio in ratios}
    for charge in CHARGES:
        cases |= {f"load_cfc0_{charge:g}": load(cfc0=charge), f"bath_step_cfc0_{charge:g}": bath_step(cfc0=charge)}
    cases |= {f"load_{share:g}_H": load(share) for share in LOADS}
    return cases | {f"bath_to_{to:g}": bath_step(to) for to in BATHS}


def compute(ratios: tuple[float, ...], cells: int, steps: int, block_cells: int, repeats: int) -> Comparison:
    """All runs."""
    cases = disturbances(ratios)
    found = {key: compare(case, cells, steps) for key, case in tqdm(cases.items(), "reductions", disable=None)}
    finer = {"mesh": compare(bath_step(), 2 * cells, steps), "step": compare(bath_step(), cells, 2 * steps)}
    blocks = {name: [block(name, block_cells) for _ in range(repeats)] for name in TIMED}
    return Comparison(ratios, found, finer, blocks)


def numbers(comparison: Comparison) -> dict[str, float | int | str]:
    """Errors, their order, their dependence on mesh and step, and costs."""
    errors = comparison.errors
    found: dict[str, float | int | str] = {}
    inner = {f"{name}_{ratio:g}" for name in DISTURBANCES for ratio in BETWEEN}
    for key in [key for key in errors if key not in inner]:
        found |= {f"{model}_error_{key}": error for model, error in errors[key].items()}
    for name in ("bath_ramp", "load"):
        slow, fast = (errors[f"{name}_{ratio:g}"]["local_donnan"] for ratio in RATIOS[1::-1])
        found[f"local_donnan_order_{name}"] = float(np.log10(slow / fast))
    base = errors["bath_step_1"]["local_donnan"]
    found |= {f"{what}_change": error["local_donnan"] / base - 1 for what, (_, error) in comparison.finer.items()}
    loaded = [run for ratio in comparison.ratios for run in comparison.found[f"load_{ratio:g}"][0]]
    found |= costs("column", {name: [r.result for r in loaded if r.model == name] for name in TIMED})
    return found | costs("block", comparison.blocks)


STYLES = {
    ("local_donnan", "bath_step"): ("s-", "LocalDonnan, sudden change of the bath"),
    ("local_donnan", "bath_ramp"): ("^--", "LocalDonnan, change within a swelling time"),
    ("local_donnan", "load"): ("o:", "LocalDonnan, sudden load"),
    ("uncharged", "load"): ("D-", "Uncharged, sudden load"),
    ("uncharged", "bath_step"): ("x-.", "Uncharged, sudden change of the bath"),
    ("effective", "load"): ("v--", "Uncharged, effective parameters, sudden load"),
}


def draw(comparison: Comparison) -> Figure:
    """Errors against the ratio of times, and against the charge."""
    errors, ratios = comparison.errors, comparison.ratios
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 4.6), sharey=True, width_ratios=(1.4, 1))
    for (model, name), (style, label) in STYLES.items():
        shade = "k" if model == "local_donnan" else "0.55"
        left.loglog(ratios, [errors[f"{name}_{r:g}"][model] for r in ratios], style, color=shade, ms=4, label=label)
        if name != "bath_ramp":
            values = [errors[f"{name}_cfc0_{charge:g}"][model] for charge in CHARGES]
            right.loglog(CHARGES, values, style, color=shade, ms=4)
    left.set(xlabel="time of salt diffusion / time of swelling, $H K / D$ [-]", title=f"charge {CHARGE:g} mol/l")
    left.set(ylabel="largest error, relative to the final displacement [-]", ylim=(5e-5, 4))
    right.set(xlabel="fixed charge $c^{fc}_0$ [mol/l]", title=f"$H K / D$ = 1, bath {BATH:g} mol/l")
    right.set_xticks(CHARGES, [f"{charge:g}" for charge in CHARGES])
    right.minorticks_off()
    letter_panels([left, right])
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
