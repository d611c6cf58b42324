"""A charged column, solid, fluid and two ions, after a sudden load and a sudden change of the bath, against its series."""

from dataclasses import replace

import numpy as np
import pytest

from ngswell import TABLE_1, Adaptive, Bath, DampedNewton, Potential, Probe, Traction, column
from ngswell.closed_forms.linear_column import LinearColumn
from tests.scenes import P0, confined_column

HEIGHT, BATH, STEP = 0.5, 0.15, 1e-6  # mm, mol/l, N/mm² or mol/l
TIMES = [1.0, 3.0, 10.0, 30.0, 100.0]
FIELDS = ("J", "p", "c_plus")
PLACES = np.array([0.125, 0.25, 0.375])


def answers(load, salt):
    """Half the difference of both signs: displacement of the top [mm] at the times, fields at the places at the third."""

    def run(sign):
        top = Probe((HEIGHT,), "displacement", when=TIMES)
        inside = [Probe((place,), *FIELDS, when=[TIMES[2]]) for place in PLACES]
        scene = confined_column(
            None, mesh=column(HEIGHT, 16, grade={"top": 6}), model=Potential(order=4), initial=(BATH, 0.0),
            baths=[Bath("top", c=BATH + sign * salt)], loads=[Traction("top", (-P0 - sign * load,))],
        )  # fmt: skip
        exact = DampedNewton(tolerance=1e-12)  # the signals are 1e-5 of the fields
        scene.run(TIMES[-1], Adaptive(1e-5), [top, *inside], newton=exact)
        return top.values["displacement"].ravel(), np.array([[probe.values[f].item() for f in FIELDS] for probe in inside])

    return [(up - down) / 2 for up, down in zip(run(1), run(-1), strict=True)]


@pytest.mark.parametrize(("load", "salt"), [(STEP, 0.0), (0.0, STEP)], ids=["load", "bath"])
def test_a_sudden_change_of_the_charged_column_is_its_series(load, salt):
    top, inside = answers(load, salt)
    change = {"salt": salt, "hydraulic": -load}  # a load is, but for the origin of p, a suction of the bath
    exact = LinearColumn(TABLE_1, BATH, HEIGHT).top_displacement(np.array(TIMES), **change)
    assert np.abs(top - exact).max() < 1e-5 * np.abs(exact).max()  # the steps' tolerance; measured 2e-6
    profiles = LinearColumn(TABLE_1, BATH, HEIGHT).profiles(PLACES, TIMES[2], **change)
    for found, name in zip(inside.T, FIELDS, strict=True):
        wanted = profiles[name] + (load if name == "p" else 0.0)
        assert np.abs(found - wanted).max() < 2e-4 * np.abs(wanted).max()  # the mesh: derivatives; measured 5e-5
    lean = replace(TABLE_1, cfc0=0.1)
    assert (
        np.abs(LinearColumn(lean, BATH, HEIGHT).top_displacement(np.array(TIMES), **change) / exact - 1).max() > 0.1
    )  # control
