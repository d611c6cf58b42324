"""What is watched: probes, integrals, ledgers, times, VTK files read back."""

import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pytest
from ngsolve import x, y

from ngswell import (
    TABLE_2,
    VTK,
    Adaptive,
    Area,
    Bath,
    Concentration,
    Essential,
    Fixed,
    Frozen,
    Integral,
    Lagged,
    Ledger,
    Multiplier,
    Nitsche,
    Penalty,
    PlaneStrain,
    Potential,
    Probe,
    Progress,
    Ramp,
    Scene,
    Snapshots,
    Symmetry,
    rectangle,
)
from tests.scenes import confined_column, strip

FALLING = Ramp((0, 0.15), (10, 0.125))


def test_times_are_landed_on_and_recorded_once():
    probe, listed, snapshots = Probe((0.5,), "J", when=7.0), Probe((0.5,), "J", when=[0.0, 3.3, 20.0]), Snapshots([12.5])
    result = confined_column(c=FALLING).run(20.0, Fixed(4.0), [probe, listed, snapshots])
    assert probe.time == pytest.approx([0, 7, 14, 20])
    assert listed.time == pytest.approx([0, 3.3, 20])
    assert [s.time for s in snapshots.states] == [12.5]
    assert 10.0 in [step.time for step in result.steps]  # the kink of the bath
    assert result.steps[-1].time == 20.0


def test_integrals_of_a_known_deformation():
    scene = strip()
    problem = scene.problem
    problem.initialise()
    problem.fields.components[0].Set((0.1 * x, 0.2 * y))
    area, top, pressure = Area(), Integral(boundary="top"), Integral("p", boundary="left")
    for observer in (area, top, pressure):
        observer.times(0.0, 1.0)
        observer.start(problem, 0.0, 1.0)
    assert area.values == pytest.approx([0.01 * 1.1 * 1.2], rel=1e-12)
    assert top.values == pytest.approx([0.02 * 1.1], rel=1e-12)
    p = scene.problem.vector[problem.ranges["p"]][0]
    assert pressure.values == pytest.approx([p * 0.5 * 1.2], rel=1e-12)


@pytest.mark.parametrize("treatment", [Penalty(1.0), Penalty(relative=1e3), Frozen(), Lagged()])
@pytest.mark.parametrize("order", [2, 3])
def test_ledger_closes(treatment, order):
    # Contents and fluxes are sums over the same test functions: what is left is Newton's last quadratic remainder.
    ledger = Ledger()
    scene = confined_column(treatment, c=FALLING, model=Concentration(order=order), cells=10)
    scene.run(60.0, Fixed(5.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-11
    assert ledger.fluid_left["top"][-1] < -1e-4  # the column swells: fluid comes in
    assert np.abs(np.diff(ledger.cations)).max() > 1e-5


@pytest.mark.parametrize("motion", [confined_column, strip])
@pytest.mark.parametrize(
    ("model", "treatment"),
    [
        (Potential(), Essential()),
        (Potential(3), Essential()),
        (Potential(), Penalty(relative=1e3)),
        (Concentration(), Nitsche()),
        (Concentration(), Nitsche(0.0, "skew")),
        (Concentration(3), Nitsche(adjoint="none")),
        (Concentration(3), Multiplier()),
    ],
)
def test_ledger_closes_for_every_model_and_treatment(model, treatment, motion):
    ledger = Ledger()
    cells = 10 if motion is confined_column else (1, 10)
    motion(treatment, c=FALLING, model=model, cells=cells).run(60.0, Fixed(5.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-11  # Newton's last quadratic remainder
    size = 0.5 if motion is confined_column else 0.5 * 0.02
    assert ledger.fluid_left["top"][-1] < -1e-4 * size
    assert np.abs(np.diff(ledger.cations)).max() > 1e-5 * size


PAIRS = [
    (Concentration(), Multiplier(), Multiplier()),
    (Concentration(), Multiplier(), Penalty(relative=1e3)),
    (Concentration(), Multiplier(), Nitsche()),
    (Concentration(), Nitsche(), Penalty(relative=1e3)),
    (Potential(), Essential(), Essential()),
    (Potential(), Essential(), Penalty(relative=1e3)),
]


@pytest.mark.parametrize(("model", "first", "second"), PAIRS)
def test_ledger_with_two_baths_that_share_a_corner(model, first, second):
    ledger = Ledger()
    scene = Scene(
        mesh=rectangle(1.0, 1.0, 3, 3),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        model=model,
        supports=[Symmetry("left"), Symmetry("bottom")],
        baths=[Bath("top", c=Ramp((0, 1.0), (100, 0.9)), treatment=first), Bath("right", c=1.0, treatment=second)],
        charge=Ramp((0, 0.0), (100, 0.5)),
    )
    scene.run(100.0, Fixed(25.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-10  # relative to what is held; Newton's remainder
    assert min(abs(ledger.fluid_left[side][-1]) for side in ("top", "right")) > 1e-4
    assert abs(ledger.cations_left["top"][-1] - ledger.cations_left["right"][-1]) > 1e-5  # the baths differ


def test_models_name_their_outputs_alike():
    one, other = (confined_column(model=model).problem.state.outputs() for model in (Concentration(), Potential()))
    assert list(one) == list(other)


@pytest.mark.parametrize(
    ("model", "treatment"),
    [(Potential(), None), (Concentration(), Multiplier()), (Concentration(), Nitsche())],
)
def test_a_run_goes_on_from_its_end(model, treatment):
    def scene():
        return confined_column(treatment, c=FALLING, model=model, cells=6)

    half = scene().run(20.0, Fixed(5.0))
    resumed = scene().run(40.0, Fixed(5.0), resume=half.end).end
    through = scene().run(40.0, Fixed(5.0)).end
    assert resumed.time == through.time
    # The first step after resuming starts without an extrapolation: Newton's remainder, 1e-8 of sizes of 1 and below.
    assert resumed.values == pytest.approx(through.values, abs=1e-9)


def test_vtk_of_the_virtual_bath_reads_back(tmp_path):
    scene = strip(None, c=FALLING, model=Potential(), cells=(1, 10))
    top = Probe((0.0, 0.5), "p", "c_plus", "c_minus", "J", when=[0.0, 30.0])
    scene.run(30.0, Fixed(10.0), [VTK(tmp_path / "series", when=[0.0, 30.0]), top])
    entries = ElementTree.parse(tmp_path / "series.pvd").getroot().findall(".//DataSet")
    data = meshio.read(tmp_path / entries[-1].get("file"))
    fields = data.point_data
    assert set(fields) >= set(scene.problem.state.outputs())
    at_top = np.argmin(np.linalg.norm(data.points - [0.0, 0.5, 0.0], axis=1))
    for name in ("p", "c_plus", "c_minus", "J"):
        assert fields[name][at_top] == pytest.approx(top.values[name][-1], rel=1e-12)
    # c₊ − c₋ is the charge at the point, J included; on the top c₊ c₋ = c̄², and P = P̄, exactly.
    assert fields["c_plus"] - fields["c_minus"] == pytest.approx(fields["cfc"], rel=1e-12)
    assert fields["cfc"] == pytest.approx(0.75 * 0.2 / (fields["J"] - 0.25), rel=1e-12)
    assert fields["c_plus"][at_top] * fields["c_minus"][at_top] == pytest.approx(0.125**2, rel=1e-12)
    assert fields["hydraulic_pressure"][at_top] == pytest.approx(-2 * scene.material.RT * 0.125, rel=1e-12)


def test_ledger_keeps_two_baths_apart():
    ledger = Ledger()
    scene = strip(baths=[Bath("top", c=FALLING, treatment=Frozen()), Bath("bottom", c=0.15, treatment=Penalty(1.0))])
    scene.run(20.0, Fixed(5.0), [ledger])
    assert max(ledger.imbalance().values()) < 1e-11
    assert set(ledger.cations_left) == {"top", "bottom"}
    assert ledger.cations_left["top"][-1] > 0  # salt leaves towards the diluted bath
    assert abs(ledger.cations_left["bottom"][-1]) < ledger.cations_left["top"][-1] / 10


def test_a_ledger_without_the_boundary_flux_would_not_close():
    ledger = Ledger()
    confined_column(c=FALLING).run(60.0, Fixed(5.0), [ledger])
    assert np.abs(ledger.fluid - ledger.fluid[0]).max() / ledger.fluid.max() > 1e-4


def test_vtk_series_reads_back(tmp_path):
    scene = strip(c=FALLING)
    top = Probe((0.0, 0.5), "displacement", "p", "c_plus", "J", "stress", when=[0.0, 10.0, 30.0])
    scene.run(30.0, Fixed(5.0), [VTK(tmp_path / "series", when=[0.0, 10.0, 30.0]), top])

    entries = ElementTree.parse(tmp_path / "series.pvd").getroot().findall(".//DataSet")
    assert [float(e.get("timestep")) for e in entries] == [0.0, 10.0, 30.0]
    for number, entry in enumerate(entries):
        data = meshio.read(tmp_path / entry.get("file"))
        fields = data.point_data
        assert set(fields) >= {
            "displacement", "J", "p", "hydraulic_pressure", "c_plus", "c_minus", "cfc", "nS", "seepage", "cation_flux",
            "stress",
        }  # fmt: skip
        assert all(np.isfinite(values).all() for values in fields.values())
        assert fields["displacement"].shape[1] == 3
        assert fields["stress"].shape[1] == 9
        at_top = np.argmin(np.linalg.norm(data.points - [0.0, 0.5, 0.0], axis=1))
        for name in ("p", "c_plus", "J"):
            assert fields[name][at_top] == pytest.approx(top.values[name][number], rel=1e-12)
        moved = top.values["displacement"][number]
        assert fields["displacement"][at_top][:2] == pytest.approx(moved, abs=1e-14)
        # c₊ − c₋ is the charge field, nS = nS0/J, and the column carries the load it is under.
        assert fields["c_plus"] - fields["c_minus"] == pytest.approx(fields["cfc"], abs=1e-12)
        assert fields["nS"] == pytest.approx(0.25 / fields["J"], rel=1e-12)
    axial = fields["stress"].reshape(-1, 3, 3)[:, 1, 1]
    assert axial == pytest.approx(-0.150037, rel=2e-3)  # stress is recovered elementwise: first-order accurate


def test_progress_is_one_line_off_a_terminal(capsys):
    confined_column().run(10.0, Fixed(5.0), [Progress("column")])
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert "2 steps" in lines[0]
    assert "Newton" in lines[0]


def test_steps_report_their_work():
    result = confined_column(c=FALLING).run(10.0, Adaptive(1e-3))
    assert all(step.iterations >= 1 and step.dt > 0 for step in result.steps)
    assert sum(step.dt for step in result.steps) == pytest.approx(10.0, rel=1e-12)
    assert result.iterations == sum(step.iterations for step in result.steps)


@pytest.mark.parametrize("model", [Concentration(), Potential()])
def test_integral_over_the_end_of_a_column_is_the_value_there(model):
    end, probe = Integral("p", boundary="top"), Probe((0.5,), "p")
    confined_column(None, c=Ramp((0, 0.15), (10, 0.125)), cells=4, model=model).run(10.0, Fixed(5.0), [end, probe])
    assert end.values == pytest.approx(probe.values["p"], rel=1e-14)
    assert np.ptp(end.values) > 0
