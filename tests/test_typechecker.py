"""Annotations are checked in every test, for the first calls of each function."""

import pytest
import torch
from jaxtyping import TypeCheckError

import typechecker
from meshot.mesh import signed_volume
from meshot.mesh.shapes import icosphere


@pytest.mark.parametrize("time", ["first", "second"])
def test_a_wrong_argument_is_seen_in_each_test(time):
    with pytest.raises(TypeCheckError):
        signed_volume(torch.zeros(3))
    for _ in range(typechecker.N_CHECKED):  # of which the second test must know nothing
        signed_volume(icosphere(0))
    with pytest.raises(AttributeError):
        signed_volume(torch.zeros(3))
