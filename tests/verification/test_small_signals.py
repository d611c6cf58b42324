"""A tolerance acts whatever the size of what a run does, and after what happens at once."""

from __future__ import annotations

import numpy as np
import pytest

from ngswell import Adaptive, Bath, Concentration, DampedNewton, Potential, Probe, Traction
from ngswell.stepping.sizes import Sizes
from tests.scenes import P0, confined_column

TOLERANCES = (1e-2, 1e-3, 1e-4)
EXACT = DampedNewton(tolerance=1e-13, slowest=0.3, most_iterations=40)


def errors(model, load=0.0, **changes):
    """Largest error of the top's displacement over its largest displacement, over each tolerance."""
    scene = confined_column(None, cells=10, model=model, loads=[Traction("top", (-P0 - load,))], **changes)
    runs = []
    for tolerance in TOLERANCES:
        top = Probe((0.5,), "displacement")
        scene.run(500.0, Adaptive(tolerance), [top])
        runs.append((tolerance, np.array(top.time), top.values["displacement"].ravel()))
    times = sorted({time for _, own, _ in runs for time in own.tolist()})
    exact = Probe((0.5,), "displacement", when=times)
    scene.run(500.0, Adaptive(1e-7), [exact], newton=EXACT)
    reference = exact.values["displacement"].ravel()
    size = np.abs(reference).max()
    return [
        np.abs(own - np.interp(at, exact.time, reference)).max() / size / tolerance  # at times that both land on
        for tolerance, at, own in runs
    ]


@pytest.mark.parametrize("model", [Potential(), Concentration()], ids=lambda model: type(model).__name__)
@pytest.mark.parametrize("load", [1e-4, 1e-3, 1e-2])
def test_a_sudden_load_of_any_size(model, load):
    # The top moves by some 1e-4 to 1e-2 of the column's length.
    assert max(errors(model, load)) < 3


def test_a_share_of_the_natural_size_is_too_much(monkeypatch):
    # The control: errors relative to at least a hundredth of the length, as they were.
    found = Sizes._sizes
    monkeypatch.setattr(Sizes, "_sizes", lambda self, *more: np.maximum(found(self, *more), self._natural()))
    assert max(errors(Potential(), 1e-4)) > 3


@pytest.mark.parametrize("model", [Potential(), Concentration()], ids=lambda model: type(model).__name__)
def test_a_sudden_bath(model):
    assert max(errors(model, baths=[Bath("top", c=0.14)], initial=(0.15, 0.0))) < 3


def test_at_rest_nothing_is_resolved():
    # Changes of round-off count as none: as few steps as growing threefold allows.
    result = confined_column(None, cells=10, model=Potential()).run(500.0, Adaptive(1e-5))
    assert len(result.steps) < 12
    assert result.rejections == 0
