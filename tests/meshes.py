"""Bodies as meshes of every cell shape, also from OpenCASCADE and Gmsh."""

from netgen.occ import Box, WorkPlane, X, Y, Z
from ngsolve import ET

from ngswell import box, column, from_occ, read_mesh, rectangle

SIDES_2D = {"bottom": 2.0, "right": 1.0, "top": 2.0, "left": 1.0}  # of 2 × 1 mm


SIDES_3D = {"left": 3.0, "right": 3.0, "front": 6.0, "back": 6.0, "bottom": 2.0, "top": 2.0}  # of 2 × 1 × 3 mm


OUTWARD = {
    "left": (-1, 0, 0),
    "right": (1, 0, 0),
    "front": (0, -1, 0),
    "back": (0, 1, 0),
    "bottom": (0, 0, -1),
    "top": (0, 0, 1),
}


def gmsh_2d(path, kind, version="2.2"):
    """2 × 1 mm as a Gmsh file: triangles, quadrilaterals or both, one turned over; a stray node; sides facing either way."""
    nodes = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (5, 5)]
    left = {"triangle": [[1, 2, 5], [1, 4, 5]], "quad": [[1, 4, 5, 2]], "mixed": [[1, 2, 5], [1, 4, 5]]}[
        kind
    ]  # some clockwise
    right = {"triangle": [[2, 3, 6], [2, 6, 5]], "quad": [[2, 3, 6, 5]], "mixed": [[2, 3, 6, 5]]}[kind]
    sides = {"bottom": [[1, 2], [2, 3]], "right": [[3, 6]], "top": [[4, 5], [5, 6]], "left": [[1, 4]]}
    write_gmsh(path, 2, nodes, left + right, sides, version)
    return path


def gmsh_3d(path, kind, version="2.2"):
    """2 × 1 × 3 mm as a Gmsh file of two hexahedra, four prisms, or one hexahedron and six pyramids."""
    place = {(i, j, k): 1 + i + 3 * j + 6 * k for k in range(2) for j in range(2) for i in range(3)}
    nodes = [(i, j, 3 * k) for i, j, k in place] + [(1.5, 0.5, 1.5)]

    def corners(i):
        return [place[i + a, b, k] for k in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]

    def prisms(i):
        c = corners(i)
        return [[c[n] for n in (0, 1, 2, 4, 5, 6)], [c[n] for n in (0, 2, 3, 4, 6, 7)]]

    def faces(i):
        c = corners(i)
        return [
            [c[n] for n in face]
            for face in ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (3, 2, 6, 7), (0, 3, 7, 4), (1, 2, 6, 5))
        ]

    cells = {
        "hexahedron": [corners(0), corners(1)[4:] + corners(1)[:4]],  # the second upside down
        "prism": prisms(0) + prisms(1),
        "pyramid": [corners(0), *([*face, 13] for face in faces(1))],
    }[kind]
    quads = {
        "left": [faces(0)[4]], "right": [faces(1)[5]],
        "front": [faces(0)[2], faces(1)[2]], "back": [faces(0)[3], faces(1)[3]],
        "bottom": [faces(0)[0], faces(1)[0]], "top": [faces(0)[1], faces(1)[1]],
    }  # fmt: skip
    if kind == "prism":
        for name, shift in (("bottom", 0), ("top", 3)):
            quads[name] = [prism[shift : shift + 3] for prism in cells]
    write_gmsh(path, 3, nodes if kind == "pyramid" else nodes[:-1], cells, quads, version)
    return path


def write_gmsh(path, dim, nodes, cells, sides, version="2.2"):
    names = {name: number for number, name in enumerate([*sides, "gel"], 1)}
    kinds = {(1, 2): 1, (2, 3): 2, (2, 4): 3, (3, 4): 4, (3, 8): 5, (3, 6): 6, (3, 5): 7}
    groups = [(dim - 1, name, side) for name, group in sides.items() for side in group] + [(dim, "gel", c) for c in cells]
    lines = ["$MeshFormat", f"{version} 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{dim - (name != "gel")} {number} "{name}"' for name, number in names.items()] + ["$EndPhysicalNames"]
    points = [f"{' '.join(str(v) for v in (*node, 0, 0)[:3])}" for node in nodes]
    if version == "2.2":
        lines += ["$Nodes", str(len(nodes)), *(f"{n} {point}" for n, point in enumerate(points, 1)), "$EndNodes"]
        lines += ["$Elements", str(len(groups))]
        for number, (d, name, cell) in enumerate(groups, 1):
            lines.append(" ".join(str(w) for w in (number, kinds[d, len(cell)], 2, names[name], names[name], *cell)))
    else:
        entities = {2: [0, len(sides), 1, 0], 3: [0, 0, len(sides), 1]}[dim]
        lines += [
            "$Entities",
            " ".join(map(str, entities)),
            *(f"{n} 0 0 0 1 1 1 1 {n} 0" for n in names.values()),
            "$EndEntities",
        ]
        lines += ["$Nodes", f"1 {len(nodes)} 1 {len(nodes)}", f"{dim} 1 0 {len(nodes)}"]
        lines += [str(n) for n in range(1, len(nodes) + 1)] + points + ["$EndNodes"]
        lines += ["$Elements", f"{len(groups)} {len(groups)} 1 {len(groups)}"]
        for number, (d, name, cell) in enumerate(groups, 1):
            lines += [f"{d} {names[name]} {kinds[d, len(cell)]} 1", " ".join(map(str, (number, *cell)))]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def occ_rectangle(**options):
    shape = WorkPlane().Rectangle(2, 1).Face()
    for name, side in (("left", X), ("right", -X), ("bottom", Y), ("top", -Y)):
        shape.edges.Min(side).name = name
    return from_occ(shape, 1.0, **options)


def occ_box():
    shape = Box((0, 0, 0), (2, 1, 3))
    for name, side in (("left", X), ("right", -X), ("front", Y), ("back", -Y), ("bottom", Z), ("top", -Z)):
        shape.faces.Min(side).name = name
    return from_occ(shape, 3.0)


def quarter_disc(maxh=0.6, order=2, **options):
    """Of radius 1 mm, in the first quadrant."""
    shape = WorkPlane().MoveTo(0, 0).Line(1).Rotate(90).Arc(1, 90).Rotate(90).Line(1).Face()
    shape.edges.name = "rim"
    shape.edges.Min(X).name = "left"
    shape.edges.Min(Y).name = "bottom"
    return from_occ(shape, maxh, order, **options)


GRADE_3D = {"top": 3.0, "bottom": 2.0, "left": 2.0}


MESHES = {
    "segments": (lambda tmp: column(2.0, 3, grade={"top": 4.0}), {ET.SEGM}),
    "quads": (lambda tmp: rectangle(2.0, 1.0, 2, 2, grade={"left": 4.0, "top": 3.0}), {ET.QUAD}),
    "triangles": (lambda tmp: rectangle(2.0, 1.0, 2, 1, triangles=True), {ET.TRIG}),
    "occ triangles": (lambda tmp: occ_rectangle(), {ET.TRIG}),
    "occ quads": (lambda tmp: occ_rectangle(quads=True), {ET.QUAD}),
    "gmsh triangles": (lambda tmp: read_mesh(gmsh_2d(tmp / "a.msh", "triangle")), {ET.TRIG}),
    "gmsh quads": (lambda tmp: read_mesh(gmsh_2d(tmp / "a.msh", "quad")), {ET.QUAD}),
    "gmsh mixed": (lambda tmp: read_mesh(gmsh_2d(tmp / "a.msh", "mixed", "4.1")), {ET.TRIG, ET.QUAD}),
    "hexahedra": (lambda tmp: box(2.0, 1.0, 3.0, 1, 1, 2, grade=GRADE_3D), {ET.HEX}),
    "prisms": (lambda tmp: box(2.0, 1.0, 3.0, 1, 1, 2, "prisms", grade=GRADE_3D), {ET.PRISM}),
    "tetrahedra": (lambda tmp: box(2.0, 1.0, 3.0, 1, 1, 1, "tetrahedra"), {ET.TET}),
    "occ tetrahedra": (lambda tmp: occ_box(), {ET.TET}),
    "gmsh hexahedra": (lambda tmp: read_mesh(gmsh_3d(tmp / "a.msh", "hexahedron")), {ET.HEX}),
    "gmsh prisms": (lambda tmp: read_mesh(gmsh_3d(tmp / "a.msh", "prism", "4.1")), {ET.PRISM}),
    "gmsh pyramids": (lambda tmp: read_mesh(gmsh_3d(tmp / "a.msh", "pyramid")), {ET.HEX, ET.PYRAMID}),
}
