"""VTK files: read back, not written over others, refused where they cannot be written."""

import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pytest

from ngswell import VTK, Fixed, InputError, OutputError, Potential, Probe
from tests.scenes import FALLING, confined_column, strip


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
    assert fields["fluid_potential"][at_top] == pytest.approx(-2 * scene.material.RT * 0.125, rel=1e-12)


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
            "displacement", "J", "p", "fluid_potential", "c_plus", "c_minus", "cfc", "nS", "seepage", "cation_flux",
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
    stress = fields["stress"].reshape(-1, 3, 3)
    assert stress[:, 1, 1] == pytest.approx(-0.150037, rel=2e-3)  # recovered elementwise: first-order accurate
    # Across the plane the strip is held as it is sideways: the same stress there, not zero.
    assert stress[:, 2, 2] == pytest.approx(stress[:, 0, 0], rel=1e-12)
    assert stress[:, 2, 2].max() < -0.1


def test_output_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    for path, words in ((tmp_path / "none" / "a", "no folder"), (tmp_path / "file" / "a", "no folder")):
        with pytest.raises(OutputError, match=words):
            strip().run(1.0, Fixed(1.0), [VTK(path)])
    with pytest.raises(InputError, match="'density'"):
        strip().run(1.0, Fixed(1.0), [VTK(tmp_path / "a", "density")])
    with pytest.raises(InputError, match="1-d"):
        confined_column().run(1.0, Fixed(1.0), [VTK(tmp_path / "a")])
    assert not list(tmp_path.glob("a*"))


def test_nothing_is_overwritten_unasked(tmp_path):
    scene = strip()
    scene.run(2.0, Fixed(1.0), [VTK(tmp_path / "run")])
    before = sorted((f.name, f.stat().st_mtime_ns) for f in tmp_path.iterdir())
    with pytest.raises(OutputError, match="overwrite=True"):
        scene.run(2.0, Fixed(1.0), [VTK(tmp_path / "run")])
    assert sorted((f.name, f.stat().st_mtime_ns) for f in tmp_path.iterdir()) == before
    scene.run(1.0, Fixed(1.0), [VTK(tmp_path / "run", overwrite=True)])
    assert len(list(tmp_path.glob("run*.vtu"))) == 2  # the old third record is gone
