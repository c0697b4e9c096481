"""A new loss and a new encoding, as CONTRIBUTING.md says: a class, a line in its table, and every system has it."""

import dataclasses

import numpy as np
import pytest
import torch

from meshot.loss.composed import ENCODINGS, LOSSES, Encoding, MeasureLoss, surface_loss
from meshot.measure.discrete import DiscreteMeasure
from meshot.mesh.shapes import icosphere
from meshot.systems import get_system

SOURCE, TARGET = icosphere(1, 10.0), icosphere(2, 10.0, centre=(3.0, 4.0, 0.0))


@dataclasses.dataclass(frozen=True)
class CentreLoss(MeasureLoss):
    """How far the centres of mass are apart, to some power."""

    power: float = 1.0

    def __call__(self, source, target, generator):
        one, other = ((m.weights[:, None] * m.points).sum(dim=0) for m in (source, target))
        return (one - other).norm() ** self.power


@dataclasses.dataclass(frozen=True)
class VertexEncoding(Encoding):
    """Every vertex, with equal weights, and lifted along the third axis."""

    lift: float = 0.0

    def measure(self, mesh, n_default, generator):
        return DiscreteMeasure(mesh.vertices + torch.tensor([0, 0, self.lift]).to(mesh.vertices))


def test_a_new_loss_needs_a_class_and_a_line(monkeypatch):
    monkeypatch.setitem(LOSSES, "centres", CentreLoss)
    loss = surface_loss({"loss": "centres", "power": 2.0, "normal_scale": 0.0, "factor": 3.0})
    assert float(loss(SOURCE, TARGET, np.random.default_rng(0))) == pytest.approx(3 * 25)
    complete = get_system("ddot").complete({"loss": {"loss": "centres"}})
    assert complete.loss.loss.power == 1.0
    with pytest.raises(ValueError, match="power is set, which sliced on varifold does not use"):
        get_system("ddot").complete({"loss": {"power": 2.0}})


def test_a_new_encoding_needs_a_class_and_a_line(monkeypatch):
    monkeypatch.setitem(ENCODINGS, "vertices", VertexEncoding)
    loss = surface_loss({"loss": "chamfer", "encoding": "vertices", "lift": 5.0})
    found = float(loss(SOURCE, SOURCE.with_vertices(SOURCE.vertices * 1.1), np.random.default_rng(0)))
    assert found == pytest.approx(2.0)  # 1 mm² each way
    complete = get_system("cortexode").complete({"loss": {"encoding": "vertices"}})
    assert (type(complete.loss.loss), complete.loss.encoding.lift) == (LOSSES["chamfer"], 0.0)
    monkeypatch.delitem(ENCODINGS, "vertices")
    with pytest.raises(ValueError, match="encoding is 'vertices'; one of varifold, samples, surface is needed"):
        get_system("cortexode").complete({"loss": {"encoding": "vertices"}})
