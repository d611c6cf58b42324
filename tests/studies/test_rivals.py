"""The scripts that ngswell is compared with solve the same equations, with steps as good as they say."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from ngswell import Adaptive, Potential
from studies.choices import speed_error
from studies.rivals import integrate
from studies.rivals.block import BLENDED, Grid
from studies.rivals.good_ngsolve import NGSolveBlock
from studies.rivals.integrate import SCHEMES, Run, extrapolate
from studies.rivals.worker import usable


class Decay:
    """x' + x + x² = 0 in the first unknown, x(0) = 1; the second follows algebraically: y = x²."""

    unknowns = 2

    def start(self):
        return np.array([1.0, 1.0])

    def at(self, time):
        pass

    prescribe = at

    def residual(self, x, step):
        return np.array([x[0] + step * (x[0] + x[0] ** 2), x[1] - x[0] ** 2])

    def content(self, x):
        return np.array([x[0], 0.0])

    def factorise(self, x, step):
        self.matrix = np.array([[1 + step * (1 + 2 * x[0]), 0.0], [-2 * x[0], 1.0]])

    def solve(self, residual):
        return np.linalg.solve(self.matrix, residual)

    def sizes(self, x):
        return abs(x[0]), abs(x[1]), 0.0


@pytest.mark.parametrize(("scheme", "order"), [("euler", 1), ("esdirk4", 4)])
def test_orders(scheme, order):
    """x(1) = 1/(2e − 1). Halved steps divide the error by 2 to the order, to 15 % where the next order is still seen."""
    errors = []
    for count in (8, 16):
        run, x, content, rate = Run(Decay(), SCHEMES[scheme], 1e-9), np.ones(2), np.array([1.0, 0.0]), np.array([2.0, 0.0])
        for number in range(count):
            stages, content, rate, _ = run.step(number / count, 1 / count, [(number / count, x)], content, rate)
            x = stages[-1][1]
        errors.append(abs(x[0] - 1 / (2 * np.e - 1)))
    assert errors[0] / errors[1] == pytest.approx(2**order, rel=0.15)
    assert x[1] == pytest.approx(x[0] ** 2, abs=1e-9)


def test_extrapolation_is_the_polynomial():
    points = [(t, np.array([t**2, 1.0])) for t in (0.0, 1.0, 3.0)]
    assert extrapolate([*points, points[-1]], 4.0) == pytest.approx([16.0, 1.0])


def test_graded_lines():
    across, along = Grid(6, 6, 6.0, 3).lines()
    for lines, end in ((across, 1.1), (along, 1.0)):
        assert lines[0] == 0
        assert lines[-1] == pytest.approx(end)
        assert np.isclose(lines, BLENDED).any()
    assert np.diff(across)[0] < np.diff(across)[-1] / 3
    assert along[1] < 0.5 * np.diff(along).max()  # thin cells at both ends
    assert along[-1] - along[-2] < 0.5 * np.diff(along).max()


def test_the_good_script_computes_the_same_block():
    """On the same uniform mesh the discrete equations are the same; the errors in time, below the tolerance, differ."""
    ours = speed_error.compute_ours(speed_error.Way(Potential(2), 4, 1.0, Adaptive(1e-4)), "test")
    theirs = Run(NGSolveBlock(Grid(4, 4, 1.0, 2), bytecode=True), SCHEMES["esdirk4"], 1e-4)
    theirs.go()
    found = integrate.outcome(theirs)
    areas = dict(zip(found["time"], found["area"], strict=True))
    for time in (7000.0, 7080.0, 8000.0, 11000.0):
        at = np.abs(ours.time - time).argmin()
        assert areas[time] == pytest.approx(ours.area[at], rel=1e-4)
    assert np.array(found["pressures"])[0] == pytest.approx(ours.pressures[0], rel=1e-4)
    assert areas[7000.0] != pytest.approx(areas[7080.0], rel=1e-2)  # the control: areas do change by more


def test_a_python_without_dolfinx_is_told(capsys):
    assert usable(None) is None
    assert usable(sys.executable) is None
    assert "no DOLFINx" in capsys.readouterr().err
