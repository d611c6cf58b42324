"""Public names: none hides, or is hidden by, what scripts import from NGSolve and Netgen."""

import netgen.csg
import netgen.geom2d
import netgen.occ
import ngsolve
import ngsolve.krylovspace
import ngsolve.meshes
import ngsolve.solvers
import pytest

import ngswell

MODULES = (ngsolve, ngsolve.solvers, ngsolve.krylovspace, ngsolve.meshes, netgen.occ, netgen.csg, netgen.geom2d)


def exported(module):
    """What `from module import *` brings."""
    return set(getattr(module, "__all__", [name for name in dir(module) if not name.startswith("_")]))


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_no_public_name_is_hidden(module):
    assert not set(ngswell.__all__) & exported(module)


def test_the_names_that_were_are_noticed():
    assert "Solid" in exported(netgen.occ)
    assert "Newton" in exported(ngsolve.solvers)
    assert set(ngswell.__all__) == exported(ngswell)
