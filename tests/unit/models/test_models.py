"""Models: orders that are refused, the names of their outputs, how they describe themselves."""

import pytest

from ngswell import Concentration, InputError, Multiplier, Nitsche, Potential
from tests.scenes import confined_column, strip


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Potential(order=1), r"Potential\(order=1\): order 2 to 6"),
        (lambda: Concentration(order=1), "order"),
        (lambda: Potential(2.0), "whole number"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_models_name_their_outputs_alike():
    one, other = (confined_column(model=model).problem.state.outputs() for model in (Concentration(), Potential()))
    assert list(one) == list(other)


def test_descriptions_name_the_model_and_the_treatment():
    text = strip(Nitsche()).describe()
    assert "fluid: storage, seepage, efflux on top, adjoint on top" in text
    assert "bath on top: Nitsche, symmetric adjoint, γ = 50" in text
    assert "adjoint on" not in strip(Nitsche(adjoint="none")).describe()
    text = strip(Multiplier()).describe()
    assert "efflux of fluid 2, efflux of cations 2" in text  # linear traces on the one edge of the strip
    assert "equilibrium with the bath: fluid on top, cations on top" in text
    assert "bath on top: Lagrange multipliers" in text
    text = strip(None, model=Potential()).describe()
    assert text.startswith("Potential, PlaneStrain, order 2")
    assert "charge" not in text  # no field of its own
    assert "efflux" not in text
    assert "bath on top: prescribed" in text
