"""What is watched: probes, integrals, times, progress; what is refused."""

import math

import numpy as np
import pytest
from ngsolve import x, y

from ngswell import (
    VTK,
    Area,
    Checkpoint,
    Concentration,
    Fixed,
    InputError,
    Integral,
    Potential,
    Probe,
    Progress,
    Ramp,
    Snapshots,
)
from tests.scenes import FALLING, confined_column, strip


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
        observer.plan(0.0, 1.0)
        observer.start(problem, 0.0, 1.0)
    assert area.values == pytest.approx([0.01 * 1.1 * 1.2], rel=1e-12)
    assert top.values == pytest.approx([0.02 * 1.1], rel=1e-12)
    p = scene.problem.vector[problem.ranges["p"]][0]
    assert pressure.values == pytest.approx([p * 0.5 * 1.2], rel=1e-12)


def test_progress_is_one_line_off_a_terminal(capsys):
    confined_column().run(10.0, Fixed(5.0), [Progress("column")])
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert "2 steps" in lines[0]
    assert "Newton" in lines[0]


@pytest.mark.parametrize("model", [Concentration(), Potential()])
def test_integral_over_the_end_of_a_column_is_the_value_there(model):
    end, probe = Integral("p", boundary="top"), Probe((0.5,), "p")
    confined_column(None, c=Ramp((0, 0.15), (10, 0.125)), cells=4, model=model).run(10.0, Fixed(5.0), [end, probe])
    assert end.values == pytest.approx(probe.values["p"], rel=1e-14)
    assert np.ptp(end.values) > 0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Snapshots(-1.0), "interval"),
        (lambda: Area(when=math.inf), "interval.*got inf"),
        (lambda: Area(when=[]), "no times"),
        (lambda: Area(when="ab"), "times.*got 'ab'"),
        (lambda: Area(when=1e-300).plan(0.0, 10.0), "more than 1000000 records"),
        (lambda: Probe(0.5, "J"), "point.*got 0.5"),
        (lambda: Probe((0.5,), ["J"]), r"quantity.*got \['J'\]"),
        (lambda: VTK(""), "path has to be a file's"),
        (lambda: VTK(-(10**6000), "J"), "path has to be a file's.*got a huge int"),  # Python writes no such number
        (lambda: Checkpoint(5), "path has to be a file's.*got 5"),
        (lambda: Probe((0.0, 0.0)), "at least one quantity"),
    ],
)
def test_parts_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize(
    ("observer", "words"),
    [
        (lambda: Probe((1.0, 0.5), "J"), "not a point"),
        (lambda: Probe((0.5,), "J"), "not a point"),
        (lambda: Probe((0.0, 0.5), "pressure"), "'pressure'.*fluid_potential"),
        (lambda: Integral("density"), "'density'"),
        (lambda: Integral("p", boundary="side"), "'side'"),
        (lambda: Snapshots([20.0]), "outside the run"),
    ],
)
def test_refused_by_the_scene(observer, words):
    scene = strip()
    with pytest.raises(InputError, match=words):
        scene.run(10.0, Fixed(5.0), [observer()])
