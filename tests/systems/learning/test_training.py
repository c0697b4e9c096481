"""What all trainings on whole scans share: settings, scaled images, digests, distances."""

import dataclasses

import numpy as np
import pytest
import torch

from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import Surface
from meshot.systems import ExampleSets
from meshot.systems.classical import EdgeGroups
from meshot.systems.learning import (
    LearningSettings,
    example_data,
    mean_distances,
    scaled_image,
    train_on_subjects,
    train_part,
)
from meshot.volume.volume import Volume
from phantoms import phantom_subjects
from refusals import refuses

KEYS = [("left", "white")]


def test_gain_and_offset_of_an_image_do_not_matter():
    data = np.random.default_rng(0).random((4, 4, 4))
    one, louder = (scaled_image(Volume(values, np.eye(4))) for values in (data, 30 * data + 5))
    torch.testing.assert_close(one, louder, atol=1e-5, rtol=0)
    assert one.shape == (1, 1, 4, 4, 4)
    assert float(one.mean()) == pytest.approx(0, abs=1e-6)
    refuses("the image is 3 everywhere; a scan is needed", scaled_image, Volume(np.full((2, 2, 2), 3.0), np.eye(4)))


def test_the_digest_knows_scans_and_truths():
    one, other = phantom_subjects(2, ())
    same = example_data(ExampleSets([one], [other]), KEYS)
    assert same == example_data(ExampleSets([one], [other]), KEYS)
    moved = dataclasses.replace(one, targets={KEYS[0]: other.targets[KEYS[0]]})
    assert example_data(ExampleSets([moved], [other]), KEYS)["training"] != same["training"]
    assert same["validation"]["n_scans"] == 1


def test_distances_are_means_over_pairs():
    inner, outer = icosphere(3, 10.0), Surface(icosphere(3, 11.0))
    found = mean_distances([(inner, outer), (inner, Surface(inner))], 500)
    assert found["validation_loss"] == pytest.approx(0.5, abs=0.02)
    broken = inner.with_vertices(inner.vertices * float("nan"))
    refuses("NaN or infinite", mean_distances, [(broken, outer)], 500)


def no_area(*_):
    raise ValueError("the mesh has no area")


def test_a_step_without_a_loss_names_its_subject():
    sets = ExampleSets(phantom_subjects(1, ()), [])
    with pytest.raises(
        FloatingPointError, match=r"the prediction of step 0 \(phantom-0\) has no loss: the mesh has no"
    ):
        train_part(torch.nn.Linear(1, 1), EdgeGroups.read({}), sets, KEYS, no_area, dict)


def test_a_validation_without_a_distance_names_its_step():
    network, settings = torch.nn.Linear(1, 1), LearningSettings(n_epochs=2, validate_every=1)
    with pytest.raises(
        FloatingPointError,
        match=r"the validation after step 3 failed: the mesh has no area; lower the learning rate\. The last saved",
    ):
        train_on_subjects(network, settings, "abc", lambda *_: network.weight.square().sum(), no_area, {})


def test_a_step_uses_the_subject_the_share_done_and_the_random_numbers_of_its_index():
    network, settings, seen = torch.nn.Linear(1, 1), LearningSettings(n_epochs=2, seed=5), []

    def loss_of(index, done, draws):
        seen.append((index, done, draws.integers(1000)))
        return network.weight.square().sum()

    train_on_subjects(network, settings, "abc", loss_of, lambda: {"validation_loss": 1.0}, {})
    orders = [np.random.default_rng([5, 0, epoch]).permutation(3) for epoch in range(2)]
    numbers = [np.random.default_rng([5, 1, step]).integers(1000) for step in range(6)]
    shares = [0, 1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6]
    assert seen == list(zip(np.concatenate(orders).tolist(), shares, numbers, strict=True))
