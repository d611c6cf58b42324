"""Tables of records with units, units, and what prints in few words."""

import csv

import numpy as np
import pytest

from ngswell import (
    TABLE_1,
    Area,
    Axisymmetric,
    Bath,
    Coarseness,
    Fixed,
    InputError,
    Integral,
    Ledger,
    MPa,
    Outflow,
    OutputError,
    PlaneStrain,
    Potential,
    Probe,
    Ramp,
    Roller,
    Scene,
    Snapshots,
    Spatial,
    Stability,
    Symmetry,
    box,
    day,
    hour,
    kPa,
    metre,
    micrometre,
    rectangle,
    year,
)
from ngswell.units import readable
from tests.scenes import FALLING, confined_column


def table(path):
    with open(path, newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, dtype=float)


def gel():
    return confined_column(None, FALLING, 3, model=Potential(), loads=())


def test_every_observer_with_records_writes_a_table(tmp_path):
    probe, ledger, outflow = Probe((0.5,), "J", "stress", "displacement"), Ledger(), Outflow("top", (0.5,))
    length, pressure, end = Area(), Integral("p"), Integral("p", "top")
    coarse, stable = Coarseness(), Stability()
    observers = [probe, ledger, outflow, length, pressure, end, coarse, stable]
    gel().run(10.0, Fixed(5.0), observers)
    written = {}
    for number, observer in enumerate(observers):
        observer.to_csv(tmp_path / f"{number}.csv")
        written[observer] = table(tmp_path / f"{number}.csv")
        assert written[observer][1][:, 0].tolist() == [0.0, 5.0, 10.0]
    stresses = [f"stress {number} [N/mm²]" for number in range(1, 10)]
    assert written[probe][0] == ["time [s]", "J [-]", *stresses, "displacement [mm]"]
    assert np.array_equal(written[probe][1][:, 2:11], probe.values["stress"].reshape(3, 9))  # all digits
    left = ["fluid left through top [mm]", "cations left through top [mol/l mm]"]
    assert written[ledger][0] == ["time [s]", "fluid [mm]", "cations [mol/l mm]", left[0], left[1]]
    at = ["fluid at 1 [mm/s]", "cations at 1 [mol/l mm/s]"]
    assert written[outflow][0] == ["time [s]", "fluid [mm/s]", "cations [mol/l mm/s]", *at]
    assert np.isnan(written[outflow][1][0, 1])  # nothing flowed before the start
    assert written[length][0] == ["time [s]", "value [mm]"]
    assert written[pressure][0] == ["time [s]", "value [N/mm² mm]"]
    assert written[end][0] == ["time [s]", "value [N/mm²]"]
    assert written[coarse][0] == ["time [s]", "total [-]"]
    assert written[stable][0] == ["time [s]", "rate [1/s]"]


@pytest.mark.parametrize(
    ("mesh", "kinematics", "supports", "power"),
    [
        (lambda: rectangle(1.0, 1.0, 1, 1), PlaneStrain(), [Symmetry("left"), Roller("bottom", "y")], "mm²"),
        (lambda: rectangle(1.0, 1.0, 1, 1), Axisymmetric(), [Symmetry("left"), Roller("bottom", "z")], "mm³"),
        (lambda: box(1.0, 1.0, 1.0, 1, 1, 1), Spatial(), [Symmetry("left"), Symmetry("front"), Symmetry("bottom")], "mm³"),
    ],
)
def test_units_follow_the_dimension(mesh, kinematics, supports, power, tmp_path):
    mesh = mesh()
    side = {"mm²": "mm", "mm³": "mm²"}[power]
    scene = Scene(
        mesh=mesh,
        kinematics=kinematics,
        material=TABLE_1,
        supports=supports,
        baths=[Bath("top", c=Ramp((0, 0.15), (9, 0.1)))],
    )
    body, top, outflow, place = Area(), Integral("p", "top"), Outflow("top"), Probe((0.5,) * mesh.dim, "displacement")
    scene.run(1.0, Fixed(1.0), [body, top, outflow, place], resume=scene.equilibrate(), unstable="off")
    units = []
    for number, observer in enumerate((body, top, outflow)):
        observer.to_csv(tmp_path / f"{number}.csv")
        units.append(table(tmp_path / f"{number}.csv")[0][1])
    assert units == [f"value [{power}]", f"value [N/mm² {side}]", f"fluid [{power}/s]"]
    place.to_csv(tmp_path / "place.csv")
    assert table(tmp_path / "place.csv")[0] == ["time [s]", *(f"displacement {n + 1} [mm]" for n in range(mesh.dim))]


def test_tables_are_refused_without_records_and_over_files(tmp_path):
    probe, snapshots = Probe((0.5,), "J"), Snapshots([5.0])
    with pytest.raises(InputError, match=r"Probe.to_csv: there are no records"):
        probe.to_csv(tmp_path / "J.csv")
    gel().run(5.0, Fixed(5.0), [probe, snapshots])
    with pytest.raises(InputError, match=r"Snapshots.to_csv: there are no records of numbers"):
        snapshots.to_csv(tmp_path / "s.csv")
    probe.to_csv(tmp_path / "J.csv")
    with pytest.raises(OutputError, match="overwrite=True"):
        probe.to_csv(tmp_path / "J.csv")
    probe.to_csv(tmp_path / "J.csv", overwrite=True)
    with pytest.raises(InputError, match="path has to be"):
        probe.to_csv(3)


def test_records_in_a_file_give_the_same_table(tmp_path):
    one, other = Probe((0.5,), "J", "stress"), Probe((0.5,), "J", "stress", to=tmp_path / "to.csv")
    gel().run(5.0, Fixed(5.0), [one, other])
    one.to_csv(tmp_path / "one.csv")
    other.to_csv(tmp_path / "other.csv")
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "other.csv").read_bytes()


def test_units_and_long_times():
    assert (MPa, kPa, metre, micrometre) == (1.0, 1e-3, 1e3, 1e-3)  # N/mm², mm
    assert (hour, day, year) == (3600.0, 86400.0, 31557600.0)  # s
    said = [readable(seconds) for seconds in (0.0, 7220.0, 1.5 * day, 2e6 * year)]
    assert said == ["0 s", "7220 s", "129600 s (1.5 d)", "6.31152e+13 s (2e+06 a)"]


def test_a_result_prints_on_one_line():
    result = confined_column(None, 0.15, 400, model=Potential(), loads=()).run(2 * day, Fixed(day))
    assert "\n" not in repr(result)
    assert len(repr(result)) < 200
    assert result.summary().startswith("t = 172800 s (2 d) after 2 steps")
