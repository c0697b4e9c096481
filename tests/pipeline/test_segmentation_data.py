"""Examples from scans and surfaces."""

import numpy as np
import pytest
import torch

from meshot.pipeline.segmentation import block_means, digest, example, read_examples, reduced_volume
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume, sample_volume
from phantoms import AFFINE, SHAPE, phantom_examples, phantom_scan, phantom_surfaces
from refusals import refuses


@pytest.fixture(scope="module")
def surfaces():
    return phantom_surfaces(0)


def test_fractions_are_what_the_surfaces_enclose_to_half_a_level(surfaces):
    scan = phantom_scan(surfaces, 0).volume
    image, fractions = example("one", scan, surfaces).tensors()
    for channel, side in enumerate(("left", "right")):
        truth = enclosed_fractions(surfaces[side], scan)
        assert np.abs(fractions[channel].numpy() - truth).max() <= 0.5 / 255 + 1e-6
    assert np.abs(image[0].numpy() - scan.data).max() <= 0.5 / 65535 + 1e-6
    assert image.dtype == fractions.dtype == torch.float32


def test_hard_labels_say_where_the_larger_part_is(surfaces):
    found = example("one", phantom_scan(surfaces, 0).volume, surfaces)
    soft, hard = found.tensors()[1], found.tensors(soft=False)[1]
    assert set(hard.unique().tolist()) == {0.0, 1.0}
    assert torch.equal(hard, (soft > 0.5).float())
    assert 0.01 < float(((soft > 0) & (soft < 1)).float().mean()) < 0.5


def test_reduction_averages_blocks_and_keeps_places(surfaces):
    data = np.arange(4 * 2 * 6.0).reshape(4, 2, 6)
    means = block_means(data, 2)
    assert means.shape == (2, 1, 3)
    assert means[1, 0, 2] == data[2:4, :, 4:6].mean()
    line = Volume(np.indices(SHAPE)[0] * AFFINE[0, 0] + AFFINE[0, 3], AFFINE)  # the value is x
    points = torch.tensor([[-7.0, 3, 2], [8.3, -4, 1]], dtype=torch.float64)
    torch.testing.assert_close(sample_volume(reduced_volume(line, 4), points), points[:, 0])
    coarse = example("one", phantom_scan(surfaces, 0).volume, surfaces, reduction=2)
    assert coarse.image.shape == (16, 12, 12)


def test_the_digest_sees_names_values_and_order():
    first, second = phantom_examples(2)
    assert digest([first, second]) == digest(phantom_examples(2))
    others = [[second, first], [first], [first, type(first)("x", second.image, second.fractions)]]
    changed = second.fractions.copy()
    changed[0, 3, 3, 3] ^= 1
    others.append([first, type(first)(second.name, second.image, changed)])
    assert len({digest(part) for part in [[first, second], *others]}) == 5


def test_bad_examples_are_refused(unchecked, surfaces, tmp_path):
    scan = phantom_scan(surfaces, 0).volume
    refuses("one surface each", example, "one", scan, {"left": surfaces["left"]})
    refuses(r"in \[0, 1\] are needed", example, "one", scan.with_data(scan.data * 300), surfaces)
    far = {side: mesh.with_vertices(mesh.vertices + 500) for side, mesh in surfaces.items()}
    refuses("are both in the same space", example, "one", scan, far)
    refuses("multiple of 5", example, "one", scan, surfaces, reduction=5)
    refuses("is no cohort", read_examples, [tmp_path], "train")
    (tmp_path / "participants.tsv").write_text("participant_id\tsplit\tkind\tseed\n")
    refuses("no scan of the split 'test'", read_examples, [tmp_path], "test")
