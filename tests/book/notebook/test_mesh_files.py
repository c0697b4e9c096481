"""Files of meshes for chapters: what is read is what was written, rounded; what does not fit is refused."""

import numpy as np
import pytest
import torch

from meshot import Mesh
from meshot.mesh import icosphere
from meshot_book.notebook import read_meshes, read_vertex_values, write_meshes

STEP = 2.0**-6


def test_meshes_and_values_go_into_a_file_and_come_back(tmp_path):
    sphere = icosphere(2, 50.0)
    kept = {
        "a": sphere,
        "b/c": sphere.with_vertices(sphere.vertices + 0.3),
        "other": Mesh(sphere.vertices, sphere.faces[:10]),
    }
    values = {"b/c": np.linspace(0, 3, len(sphere.vertices))}
    write_meshes(tmp_path / "m.gz", kept, STEP, values)
    found = read_meshes(tmp_path / "m.gz")
    assert list(found) == list(kept)
    for name, mesh in kept.items():
        assert torch.equal(found[name].faces, mesh.faces)
        assert float((found[name].vertices - mesh.vertices).abs().max()) <= STEP / 2 + 1e-12
    numbers = read_vertex_values(tmp_path / "m.gz")
    assert list(numbers) == ["b/c"]
    np.testing.assert_allclose(numbers["b/c"], values["b/c"], rtol=2**-11)


def test_a_similar_mesh_costs_less_than_another_one(tmp_path):
    draws, sizes = np.random.default_rng(0), []
    first, second = (torch.linalg.qr(torch.from_numpy(draws.normal(size=(3, 3))))[0] for _ in range(2))
    sphere = icosphere(4, 50.0)
    base = sphere.with_vertices(sphere.vertices @ first)
    for other in (None, 1.0005 * base.vertices, sphere.vertices @ second):
        meshes = {"a": base} | ({} if other is None else {"b": base.with_vertices(other)})
        write_meshes(tmp_path / "m.gz", meshes, STEP)
        sizes.append((tmp_path / "m.gz").stat().st_size)
    assert sizes[1] - sizes[0] < 0.5 * (sizes[2] - sizes[0])


@pytest.mark.parametrize("mesh", [icosphere(6), icosphere(1, 600.0)])
def test_what_does_not_fit_into_16_bits_is_refused(tmp_path, mesh):
    with pytest.raises(ValueError, match=r"big has \d+ vertices up to .*: simplify it, or take longer steps"):
        write_meshes(tmp_path / "m.gz", {"big": mesh}, STEP)
    assert not list(tmp_path.iterdir())
