"""Permeabilities that depend on direction: fluxes at a point, consolidation along and across, rest, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import CF, x, y, z

from ngswell import (
    TABLE_2,
    Adaptive,
    Bath,
    Concentration,
    HolmesMow,
    InputError,
    Material,
    Multiplier,
    Nitsche,
    Orthotropic,
    Penalty,
    PlaneStrain,
    Potential,
    PowerLaw,
    Ramp,
    Roller,
    Scene,
    Spatial,
    Symmetry,
    Traction,
    TransverselyIsotropic,
    Uncharged,
    box,
    rectangle,
)
from ngswell.closed_forms.consolidation import consolidation_coefficient, terzaghi_settlement
from ngswell.closed_forms.linear_column import storage

GENERAL = np.array([[1.3, 0.2, 0.1], [-0.1, 1.2, 0.05], [0.05, 0.3, 0.9]])
PLANE = np.array([[1.3, 0.2, 0.0], [-0.1, 1.2, 0.0], [0.0, 0.0, 1.0]])
AXIS, NORMAL = (1.0, 2.0, -0.5), (2.0, -1.0, 0.0)  # at right angles
LAWS = {
    "transversely isotropic": TransverselyIsotropic(AXIS, 3.0, HolmesMow(1.0, 0.5)),
    "orthotropic": Orthotropic(AXIS, NORMAL, 3.0, 0.2, PowerLaw(2.0)),
}
GRADIENTS = np.array([0.3, -0.2, 0.5]), np.array([0.1, 0.4, -0.3])  # of the pressure and of the salt, in the reference body


def tensor(law, F, m):
    """K of the deformed body from its axes, written out."""
    q = F @ np.array(AXIS)
    q /= np.linalg.norm(q)
    ratios = {"along": law.ratio, "through": 1.0} if isinstance(law, TransverselyIsotropic) else vars(law)
    n = np.linalg.inv(F).T @ np.array(NORMAL)
    n /= np.linalg.norm(n)
    K = law.law(m.K, np.linalg.det(F), m.nS0)
    return K * (np.eye(3) + (ratios["along"] - 1) * np.outer(q, q) + (ratios["through"] - 1) * np.outer(n, n))


def deformed(model, F, law):
    """A state of uniform F with linear fields, and a point of it."""
    space = F is GENERAL
    mesh = box(1, 1, 1, 1, 1, 1) if space else rectangle(1, 1, 2, 2)
    charge = {"cfc0": 0.0} if isinstance(model, Uncharged) else {}
    scene = Scene(
        mesh=mesh, kinematics=Spatial() if space else PlaneStrain(), model=model,
        material=replace(TABLE_2, permeability=law, **charge),
        supports=[Symmetry("left"), Symmetry("bottom"), *([Symmetry("front")] if space else [])],
        baths=[Bath("right", c=None if charge else 0.3)],
    )  # fmt: skip
    place = (x, y, z)
    dim = mesh.dim
    fields = scene.problem.fields.components
    fields[0].Set(CF(tuple(sum(float(F[i, j] - (i == j)) * place[j] for j in range(dim)) for i in range(dim))))
    for field, gradient, base in zip(fields[1:], GRADIENTS, (0.2, 0.7), strict=False):
        field.Set(base + sum(float(gradient[j]) * place[j] for j in range(dim)))
    return scene, mesh(*(0.4, 0.4, 0.4)[:dim])


@pytest.mark.parametrize("F", [GENERAL, PLANE], ids=["3-d", "plane"])
@pytest.mark.parametrize("law", LAWS.values(), ids=list(LAWS))
def test_seepage_is_that_of_the_tensor_of_the_deformed_axes(law, F):
    scene, point = deformed(Uncharged(), F, law)
    dim, state = scene.mesh.dim, scene.problem.state
    gradient = np.where(np.arange(3) < dim, GRADIENTS[0], 0.0)
    wanted = -tensor(law, F, scene.material) @ np.linalg.inv(F).T @ gradient
    assert np.array(state.output("seepage")(point)) == pytest.approx(wanted[:dim], rel=1e-11)  # round-off
    pulled = np.linalg.det(F) * np.linalg.inv(F) @ np.where(np.arange(3) < dim, wanted, 0.0)
    assert np.array(state.seepage(state.pull)(point)) == pytest.approx(pulled[:dim], rel=1e-11)  # as in the balance
    scalar, _ = deformed(Uncharged(), F, law.law)
    assert np.abs(np.array(scalar.problem.state.output("seepage")(point)) / wanted[:dim] - 1).max() > 0.1  # control


@pytest.mark.parametrize("law", LAWS.values(), ids=list(LAWS))
@pytest.mark.parametrize("model", [Concentration(), Potential()])
def test_ions_with_a_tensor(model, law):
    """(19) to (22) with K a matrix: zero current solved for the electric field as a vector."""
    scene, point = deformed(model, GENERAL, law)
    m, state = scene.material, scene.problem.state
    nF, cfc, c = (float(state.output(name)(point)) for name in ("nS", "cfc", "c_plus"))
    nF, push = 1 - nF, np.linalg.inv(GENERAL).T
    if isinstance(model, Concentration):
        drive, of_cations = push @ GRADIENTS[0], push @ GRADIENTS[1]
        of_anions = of_cations - push @ np.zeros(3)
    else:  # uniform charge: c₊ − c₋ uniform, c₊ c₋ = c̃²
        salt = float(scene.problem.fields.components[2](point))
        of_cations = of_anions = 2 * salt * (push @ GRADIENTS[1]) / (2 * c - cfc)
        drive = push @ GRADIENTS[0] + m.RT * 2 * of_cations - 2 * m.RT * push @ GRADIENTS[1]
    K = tensor(law, GENERAL, m)

    def fluxes(field):  # grad E/Rθ
        fluid = -K @ (drive + m.RT * cfc * field)
        plus = -nF * m.D_plus * (of_cations + c * field) + c * fluid
        minus = -nF * m.D_minus * (of_anions - (c - cfc) * field) + (c - cfc) * fluid
        return fluid, plus, plus - minus

    at_zero = fluxes(np.zeros(3))[2]
    slope = np.column_stack([fluxes(unit)[2] - at_zero for unit in np.eye(3)])
    fluid, plus, _ = fluxes(np.linalg.solve(slope, -at_zero))
    assert np.array(state.output("seepage")(point)) == pytest.approx(fluid, rel=1e-9)  # round-off
    assert np.array(state.output("cation_flux")(point)) == pytest.approx(plus, rel=1e-9)


SOFT = Material(mu=0.24, lam=0.16, nS0=0.25, K=1e-3)


@pytest.mark.parametrize(
    "law", [TransverselyIsotropic((0, 1, 0), 5.0), Orthotropic((1, 0, 0), (0, 1, 0), 1.0, 5.0)], ids=str
)
@pytest.mark.parametrize("side", ["top", "right"])
def test_consolidation_along_and_across(law, side):
    """A confined block drained at one side, of 5 K along y and K along x: Terzaghi's settlement with the K of the flow."""
    ratio, load = 5.0 if side == "top" else 1.0, 1e-6
    held = {
        "top": [Roller("left|right", "x"), Roller("bottom", "y")],
        "right": [Roller("left", "x"), Roller("bottom|top", "y")],
    }
    push = {"top": (0.0, -load), "right": (-load, 0.0)}
    cells = {"top": (1, 16), "right": (16, 1)}
    scene = Scene(
        mesh=rectangle(1, 1, *cells[side], grade={side: 10.0}), kinematics=PlaneStrain(), model=Uncharged(),
        material=replace(SOFT, permeability=law), supports=held[side], baths=[Bath(side)],
        loads=[Traction(side, push[side])],
    )  # fmt: skip
    until = 0.1 / (1e-3 * 0.64) / ratio  # T = 0.1 of 1 mm
    end = scene.run(until, Adaptive(1e-3)).state
    found = -end.at((0.5, 1.0) if side == "top" else (1.0, 0.5), "displacement")[side == "top"]
    exact = terzaghi_settlement(replace(SOFT, K=ratio * 1e-3), load, 1.0, until)
    assert found == pytest.approx(exact, rel=3e-3)  # three times the tolerance of the steps
    other = terzaghi_settlement(replace(SOFT, K=(6 - ratio) * 1e-3), load, 1.0, until)
    assert abs(other / exact - 1) > 0.3  # control: the K of the other direction


def test_models_and_treatments_agree_on_the_way():
    directed = replace(TABLE_2, permeability=Orthotropic((1, 1, 0), (1, -1, 0), 4.0, 0.5, PowerLaw(1.0)))

    def middle(model, treatment, material=directed):
        scene = Scene(
            mesh=rectangle(1, 1, 6, 6, grade={"top": 4.0, "right": 4.0}), kinematics=PlaneStrain(), model=model,
            material=material, supports=[Symmetry("left"), Symmetry("bottom")],
            baths=[Bath("top|right", c=0.3, treatment=treatment)], charge=Ramp((0, 0.0), (2000, 1.0)),
        )  # fmt: skip
        return scene.run(1000.0, Adaptive(1e-2)).state.at((0.2, 0.3), "displacement")

    prescribed = np.array(middle(Potential(), None))
    # The same limit: on 6 × 6 cells all are 2.7 % off it, on 12 × 12 0.65 %, and a tenth of that from each other.
    weak = Penalty(relative=1e3)
    for model, treatment in [(Concentration(), Nitsche()), (Concentration(), Multiplier()), (Potential(), weak)]:
        assert np.array(middle(model, treatment)) == pytest.approx(prescribed, rel=2e-3)
    same = replace(TABLE_2, permeability=PowerLaw(1.0))
    assert abs(np.array(middle(Potential(), None, same)) / prescribed - 1).min() > 0.2  # control: the directions matter


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: TransverselyIsotropic((0, 0, 0), 2.0), "axis .* has no length"),
        (lambda: TransverselyIsotropic((1, 0, 0), 0.0), "ratio = 0 is outside"),
        (lambda: TransverselyIsotropic((1, 0), 2.0), "three components"),
        (lambda: Orthotropic((1, 0, 0), (1, 1, 0), 2.0, 1.0), "right angles, their cosine is 0.707"),
        (lambda: Orthotropic((1, 0, 0), (0, 1, 0), -2.0, 1.0), "along = -2"),
        (lambda: deformed(Uncharged(), PLANE, TransverselyIsotropic(CF((0 * x, 0, 0)), 2.0)), "axis has the length 0 at"),
        (lambda: deformed(Uncharged(), PLANE, Orthotropic(CF((x, 1, 0)), (0, 1, 0), 2.0, 1.0)), "right angles"),
        (lambda: consolidation_coefficient(replace(SOFT, permeability=LAWS["orthotropic"])), "depends on direction"),
        (lambda: storage(replace(TABLE_2, permeability=LAWS["orthotropic"]), 0.3), "depends on direction"),
    ],
)  # fmt: skip
def test_what_a_direction_of_flow_may_not_be(make, says):
    with pytest.raises(InputError, match=says):
        make()


def test_a_ratio_of_one_is_no_direction():
    plain, _ = deformed(Potential(), GENERAL, PowerLaw(2.0))
    alike, point = deformed(Potential(), GENERAL, Orthotropic(AXIS, NORMAL, 1.0, 1.0, PowerLaw(2.0)))
    for name in ("seepage", "cation_flux"):
        found = np.array(alike.problem.state.output(name)(point))
        assert found == pytest.approx(np.array(plain.problem.state.output(name)(point)), rel=1e-11)
