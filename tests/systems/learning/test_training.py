"""What all trainings on whole scans share: settings, scaled images, digests, distances."""

import dataclasses

import numpy as np
import pytest
import torch

from meshot.mesh.shapes.solids import icosphere
from meshot.metrics.distances import Surface
from meshot.systems import ExampleSets
from meshot.systems.learning.scans import example_data, scaled_image
from meshot.systems.learning.settings import LearningSettings, completed_groups
from meshot.systems.learning.training import mean_distances, train_part
from meshot.volume.volume import Volume
from phantoms import phantom_subjects

KEYS = [("left", "white")]


def test_settings_in_epochs_become_steps():
    plan = LearningSettings(n_epochs=3, validate_every=2).plan(5)
    assert (plan.n_steps, plan.validate_every) == (15, 10)
    groups = completed_groups("it", {"training": {"seed": 4}}, {"training": LearningSettings})
    assert groups["training"] == dataclasses.asdict(LearningSettings(seed=4))
    with pytest.raises(ValueError, match=r"the configuration of it sets training\.speed, which nothing reads"):
        completed_groups("it", {"training": {"speed": 4}}, {"training": LearningSettings})
    with pytest.raises(ValueError, match="the configuration of it is invalid: n_points is 0"):
        completed_groups("it", {"training": {"n_points": 0}}, {"training": LearningSettings})


def test_gain_and_offset_of_an_image_do_not_matter():
    data = np.random.default_rng(0).random((4, 4, 4))
    one, louder = (scaled_image(Volume(values, np.eye(4))) for values in (data, 30 * data + 5))
    torch.testing.assert_close(one, louder, atol=1e-5, rtol=0)
    assert one.shape == (1, 1, 4, 4, 4)
    assert float(one.mean()) == pytest.approx(0, abs=1e-6)
    with pytest.raises(ValueError, match="the image is 3 everywhere; a scan is needed"):
        scaled_image(Volume(np.full((2, 2, 2), 3.0), np.eye(4)))


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
    with pytest.raises(FloatingPointError, match=r"a validation failed: .*lower the learning rate"):
        mean_distances([(broken, outer)], 500)


def test_a_step_without_a_loss_names_its_subject():
    sets = ExampleSets(phantom_subjects(1, ()), [])

    def none(index, draws):
        raise ValueError("the mesh has no area")

    with pytest.raises(
        FloatingPointError, match=r"the prediction of step 0 \(phantom-0\) has no loss: the mesh has no"
    ):
        train_part(torch.nn.Linear(1, 1), LearningSettings(), sets, none, dict, {})
