"""Gmsh files: those of other programs, groups and names, and what is refused."""

import sys

import meshio
import numpy as np
import pytest
from ngsolve import CF, Integrate

from ngswell import InputError, read_mesh
from tests.meshes import (
    gmsh_2d,
    write_gmsh,
)


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda text: text.replace("2.2 0 8", "4 0 8"), "version 4 .*4.1"),
        (lambda text: text.replace("2.2 0 8", "2.2 1 8"), "not well formed.*save again"),  # text that calls itself binary
        (lambda text: "solid\n" + text[40:], "not a Gmsh mesh"),
        (lambda text: text[: len(text) // 2], "cut short"),
        (lambda text: text[: text.index("\n$EndElements") - 1], "cut short"),  # within the last cell
        (lambda text: text.replace("\n7 5 5 0\n", "\n"), "not well formed"),
        (lambda text: text.replace("\n7 5 5 0\n", "\n7 5 5 o\n"), "not well formed"),
        (
            lambda text: text.replace("$PhysicalNames", "$Names").replace("$EndPhysicalNames", "$EndNames"),
            "no boundary has a name",
        ),
        (lambda text: text.replace("1 1 2 1 1 1 2", "1 8 2 1 1 1 2 3"), "not straight.*ElementOrder"),
        (lambda text: text.replace("1 1 2 1 1 1 2", "1 1 2 1 1 1 6"), "'bottom' near .* no side"),
        (lambda text: text.replace("2 1 2 1 1 2 3", "2 1 2 1 1 2 1"), r"line near \(0.5, 0, 0\) mm .* two physical groups"),
        (lambda text: text.replace("5 1 1 0", "5 1 1 0.5"), "z = 0.5 mm"),
        (lambda text: text.replace("2 1 2 1 1 2 3", "2 1 2 1 1 2 9"), "not well formed"),
        (
            lambda text: text.replace("\n7 5 5 0\n", "\n10 5 5 0\n").replace("2 1 2 1 1 2 3", "2 1 2 1 1 2 9"),
            "does not hold",
        ),
        (lambda text: text.replace("5 1 1 0", "5 2.5 -0.5 0"), "turned inside out"),
    ],
)
def test_bad_gmsh_files(edit, words, tmp_path):
    path = gmsh_2d(tmp_path / "a.msh", "quad")
    text = path.read_text()
    assert edit(text) != text
    path.write_text(edit(text))
    with pytest.raises(InputError, match=words):
        read_mesh(path)


def test_gmsh_files_that_are_none(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_mesh(tmp_path / "none.msh")
    (tmp_path / "a.msh").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="not a Gmsh mesh"):
        read_mesh(tmp_path / "a.msh")
    write_gmsh(tmp_path / "b.msh", 1, [(0,), (1,)], [[1, 2]], {})
    with pytest.raises(InputError, match="column"):
        read_mesh(tmp_path / "b.msh")


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_gmsh_file_of_another_program(version, binary, tmp_path, capsys):
    points = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)], dtype=float)
    cells = [("line", np.array([[0, 1], [1, 2]])), ("line", np.array([[2, 3], [3, 0]])), ("quad", np.array([[0, 1, 2, 3]]))]
    mesh = meshio.Mesh(points, cells)
    tags = [np.array([1, 1]), np.array([2, 2]), np.array([3])]
    mesh.cell_data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    mesh.field_data = {"floor and right": np.array([1, 1]), "rest": np.array([2, 1]), "gel": np.array([3, 2])}
    mesh.point_data = {"gmsh:dim_tags": np.array([(1, 1), (1, 1), (1, 2), (2, 3)])}
    meshio.gmsh.write(tmp_path / "a.msh", mesh, version, binary=binary)
    capsys.readouterr()
    got = read_mesh(tmp_path / "a.msh")
    assert capsys.readouterr() == ("", "")
    assert set(got.GetBoundaries()) == {"floor and right", "rest"}
    assert got.GetMaterials() == ("gel",)
    assert Integrate(CF(1.0), got, definedon=got.Boundaries("rest")) == pytest.approx(3.0, rel=1e-12)
    assert Integrate(CF(1.0), got) == pytest.approx(2.0, rel=1e-12)
    content = (tmp_path / "a.msh").read_bytes()
    (tmp_path / "a.msh").write_bytes(content[: content.index(b"$EndElements") - 8])
    with pytest.raises(InputError, match="cut short"):
        read_mesh(tmp_path / "a.msh")


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_gmsh_groups_of_one_name_and_of_none(version, tmp_path):
    # Two groups of curves and the body share a name; the group of the left side has none and is sealed and free.
    path = gmsh_2d(tmp_path / "a.msh", "quad", version)
    text = path.read_text().replace('"gel"', '"top"').replace('"right"', '"top"').replace('1 4 "left"\n', "")
    path.write_text(text.replace("$PhysicalNames\n5", "$PhysicalNames\n4"))
    mesh = read_mesh(path)
    assert set(mesh.GetBoundaries()) - {"default"} == {"bottom", "top"}
    assert mesh.GetMaterials() == ("top",)
    assert Integrate(CF(1.0), mesh, definedon=mesh.Boundaries("top")) == pytest.approx(3.0, rel=1e-12)


def test_gmsh_entities_in_two_groups_or_none(tmp_path):
    path = gmsh_2d(tmp_path / "a.msh", "quad", "4.1")
    text = path.read_text()
    assert "\n1 0 0 0 1 1 1 1 1 0\n" in text
    for groups in ("2 1 3", "2 3 1", "2 9 1"):  # the last: an unnamed group in front
        path.write_text(text.replace("\n1 0 0 0 1 1 1 1 1 0\n", f"\n1 0 0 0 1 1 1 {groups} 0\n"))
        with pytest.raises(InputError, match=r"two physical groups.*'bottom'"):
            read_mesh(path)
    # Saved without its group, beside others with theirs: meshio cannot tell which is which.
    path.write_text(text.replace("\n1 0 0 0 1 1 1 1 1 0\n", "\n1 0 0 0 1 1 1 0 0\n"))
    with pytest.raises(InputError, match="SaveAll = 0"):
        read_mesh(path)
    # Turned over by Gmsh: the same group.
    path.write_text(text.replace("\n1 0 0 0 1 1 1 1 1 0\n", "\n1 0 0 0 1 1 1 1 -1 0\n"))
    assert "bottom" in read_mesh(path).GetBoundaries()


def test_gmsh_files_need_meshio(tmp_path, monkeypatch):
    path = gmsh_2d(tmp_path / "a.msh", "quad")
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(InputError, match=r"pip install ngswell\[gmsh\]"):
        read_mesh(path)


def test_stray_nodes_are_left_out(tmp_path):
    # Nodes of no cell would be vertices without an equation.
    assert read_mesh(gmsh_2d(tmp_path / "a.msh", "quad")).nv == 6
