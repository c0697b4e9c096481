"""A hemisphere on disk: small, and read back so that neither surfaces nor flows notice."""

import dataclasses
import re

import numpy as np
import pytest
import safetensors
import safetensors.numpy
import torch

from meshot.mesh.shapes import icosphere
from meshot.model.deformation import DeformationNetwork
from meshot.systems.flows import deformed
from meshot.volume.volume import Volume
from meshot_book import example_file as deformation_file
from meshot_book.example_file import read_example, write_example
from phantoms import phantom_deformations
from refusals import refuses


@pytest.fixture(scope="module")
def example():
    """A phantom in the middle of a larger image, so that there is something to cut away."""
    (found,) = phantom_deformations(1)
    data = np.random.default_rng(0).uniform(size=(64, 61, 56)).astype(np.float32)
    affine = found.scan.affine.copy()
    affine[:3, 3] -= affine[:3, :3] @ [16, 18, 16]
    return dataclasses.replace(found, scan=Volume(data, affine))


def test_what_is_read_is_what_was_written(example, tmp_path):
    path = tmp_path / "one.safetensors"
    write_example(path, example, {"commit": "abc"})
    found, record = read_example(path)
    assert record == {"commit": "abc", "name": example.name}
    assert found.scan.data.size < example.scan.data.size
    for name in ("initial", "target"):
        mesh, wanted = getattr(found, name), getattr(example, name)
        assert torch.equal(mesh.faces, wanted.faces)
        torch.testing.assert_close(mesh.vertices, wanted.vertices, atol=3e-4, rtol=0)


def test_a_flow_hardly_notices(example, tmp_path):
    path = tmp_path / "one.safetensors"
    write_example(path, example, {})
    found, _ = read_example(path)
    network = DeformationNetwork(8, (8,), 3, 5, extent=20.0).float()
    with torch.no_grad():
        network.to_velocity.weight.copy_(torch.randn(3, 8, generator=torch.Generator().manual_seed(0)))
    ends = [deformed(example.initial, scan, network, 5).vertices for scan in (example.scan, found.scan)]
    way = float((ends[0] - example.initial.vertices).norm(dim=1).mean())
    assert way > 0.5
    apart = (ends[1] - ends[0]).norm(dim=1)
    assert float(apart.mean()) < 0.005 * way  # 256 greys, of which the border has a tenth
    assert float(apart.max()) < 0.1 * way


def test_true_surfaces_are_simplified(example, tmp_path):
    write_example(tmp_path / "one.safetensors", example, {}, n_target_faces=1000)
    assert len(read_example(tmp_path / "one.safetensors")[0].target.faces) == 1000


def test_doors(example, tmp_path, monkeypatch):
    path = tmp_path / "one.safetensors"
    bright = dataclasses.replace(example, scan=example.scan.with_data(2 * example.scan.data))
    refuses(re.escape("[0, 1] is needed"), write_example, path, bright, {})
    fine = dataclasses.replace(example, initial=icosphere(7, dtype=torch.float32))
    refuses("163842 vertices", write_example, path, fine, {})
    monkeypatch.setattr(deformation_file, "LARGEST_BYTES", 1000)
    refuses("MB are kept", write_example, path, example, {})
    assert not path.exists()
    refuses("does not hold a hemisphere", read_example, path)
    path.write_bytes(b"nothing")
    refuses("does not hold a hemisphere", read_example, path)


def test_a_damaged_scan_is_refused(example, tmp_path):
    path = tmp_path / "one.safetensors"
    write_example(path, example, {})
    with safetensors.safe_open(path, framework="numpy") as file:
        tensors, metadata = {name: file.get_tensor(name) for name in file.keys()}, file.metadata()  # noqa: SIM118
    greys = tensors["scan_zlib"].copy()
    greys[len(greys) // 2] ^= 255
    safetensors.numpy.save_file(tensors | {"scan_zlib": greys}, path, metadata)
    refuses("does not hold a hemisphere", read_example, path)
    safetensors.numpy.save_file(tensors | {"scan_shape": np.array([2, 2, 2])}, path, metadata)
    refuses("does not hold a hemisphere", read_example, path)
