"""examples/indentation.py: the force on the ball relaxes to that of the layer at rest."""

from pathlib import Path

import pytest

from examples import indentation


def test_the_force_falls_to_that_of_rest():
    time, force = indentation.indentation(cells=8)
    assert time[force.argmax()] == pytest.approx(1.0)
    # 14 cells a side have 62.4 and 37.0 mN; at the peak fluid has left a thin layer only, which 8 cells resolve less.
    assert force.max() == pytest.approx(62.4e-3, rel=0.03)
    assert force[-1] == pytest.approx(37.0e-3, rel=0.01)
    assert len(Path(indentation.__file__).read_text(encoding="utf-8").splitlines()) <= 40
