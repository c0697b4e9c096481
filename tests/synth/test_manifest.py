"""Hashes by content: another packing changes none, any other number in a file does."""

import gzip

import nibabel
import numpy as np
import pytest

from meshot.mesh.io import write_mesh
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.synth.generation import content_hash
from meshot.volume.io import write_volume
from meshot.volume.volume import Volume

IMAGE = np.random.default_rng(0).integers(0, 500, (4, 6, 5)).astype(np.int16)
AFFINE = np.diag([1.0, 1.0, 1.2, 1.0])
SPHERE = icosphere(1, 10.0)


def of_volume(folder, image, affine=AFFINE):
    write_volume(folder / "a.nii.gz", Volume(image, affine))
    return content_hash(folder / "a.nii.gz")


def of_mesh(folder, mesh):
    write_mesh(folder / "a.surf.gii", mesh)
    return content_hash(folder / "a.surf.gii")


def test_another_packing_is_the_same_content(tmp_path):
    volume, mesh = tmp_path / "a.nii.gz", tmp_path / "a.surf.gii"
    found, before = [of_volume(tmp_path, IMAGE), of_mesh(tmp_path, SPHERE)], [p.read_bytes() for p in (volume, mesh)]
    volume.write_bytes(gzip.compress(gzip.decompress(before[0]), 1))
    image = nibabel.load(mesh)
    for array in image.darrays:
        array.encoding = nibabel.gifti.gifti.gifti_encoding_codes.code["GIFTI_ENCODING_B64BIN"]
    nibabel.save(image, mesh)
    assert [p.read_bytes() == b for p, b in zip((volume, mesh), before, strict=True)] == [False, False]
    assert [content_hash(volume), content_hash(mesh)] == found


def test_every_number_of_a_volume_counts(tmp_path):
    other, moved = IMAGE.copy(), AFFINE.copy()
    other[1, 2, 3] += 1
    moved[0, 3] += 0.001
    variants = [(IMAGE, AFFINE), (other, AFFINE), (IMAGE, moved), (IMAGE.reshape(6, 4, 5), AFFINE)]
    assert len({of_volume(tmp_path, *variant) for variant in variants}) == len(variants)


def test_every_number_of_a_mesh_counts(tmp_path):
    moved = SPHERE.vertices.clone()
    moved[3, 1] += 0.001
    turned = SPHERE.faces.clone()
    turned[5] = turned[5].flip(0)
    variants = [SPHERE, SPHERE.with_vertices(moved), Mesh(SPHERE.vertices, turned)]
    assert len({of_mesh(tmp_path, mesh) for mesh in variants}) == len(variants)


@pytest.mark.parametrize("name", ["a.nii.gz", "a.surf.gii"])
def test_what_cannot_be_read_has_no_hash(tmp_path, name):
    (tmp_path / name).write_bytes(b"half")
    with pytest.raises(ValueError, match=name):
        content_hash(tmp_path / name)


def test_other_files_are_hashed_by_their_bytes(tmp_path):
    for name, text in (("a.json", "{}"), ("b.json", "{}"), ("c.json", "{ }")):
        (tmp_path / name).write_text(text)
    a, b, c = (content_hash(tmp_path / f"{x}.json") for x in "abc")
    assert a == b != c
