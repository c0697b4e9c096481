"""Training: it learns, goes on after a kill as if nothing had been, and refuses what does not belong to it."""

import copy
import dataclasses
import itertools
import json

import numpy as np
import pytest
import torch

from killing import same, without_seconds
from meshot.model import SegmentationNetwork
from meshot.pipeline.segmentation import (
    Example,
    SegmentationConfig,
    _batch,
    initial_surfaces,
    read_segmentation_config,
    segment,
    train_segmentation,
)
from meshot.train.engine import read_log
from phantoms import phantom_examples, phantom_scan, phantom_surfaces
from refusals import refuses

TINY = SegmentationConfig.read(
    {
        "network": {"width": 4, "depth": 2, "fold": 2},
        "training": {"n_epochs": 3, "learning_rate": 0.01, "save_every": 2, "shift": 1, "schedule": "cosine"},
    }
)


class Kill(Exception):
    """A process that ends in the middle."""


def changed(**settings: object) -> SegmentationConfig:
    return SegmentationConfig(TINY.network, dataclasses.replace(TINY.training, **settings))


@pytest.fixture(scope="module")
def examples() -> tuple[list[Example], list[Example]]:
    torch.set_num_threads(1)
    return phantom_examples(3), phantom_examples(2, seed=50)


@pytest.fixture(scope="module")
def whole(examples):
    return train_segmentation(TINY, *examples)


def test_the_log_tells_every_step_and_every_validation(whole, examples):
    steps = [line for line in whole.log if "loss" in line]
    checks = [line for line in whole.log if "validation_loss" in line]
    assert [line["step"] for line in steps] == list(range(1, 10))
    assert [line["step"] for line in checks] == [3, 6, 9]
    assert checks[-1]["validation_loss"] < checks[0]["validation_loss"]
    assert whole.best_step == min(checks, key=lambda line: line["validation_loss"])["step"]
    assert steps[0]["learning_rate"] == 0.01
    assert steps[-1]["learning_rate"] < 0.001
    assert whole.data["training"]["n_scans"] == 3
    assert whole.data["training"]["sha256"] != whole.data["validation"]["sha256"]


@pytest.mark.parametrize("stop", sorted({*np.random.default_rng(7).integers(1, 9, 2).tolist(), 3}))
def test_a_killed_training_ends_with_the_same_weights(tmp_path, whole, examples, stop):
    def die(step: int, n_steps: int, line: dict) -> None:
        assert n_steps == 9
        if step == stop and "loss" in line:
            raise Kill

    with pytest.raises(Kill):
        train_segmentation(TINY, *examples, folder=tmp_path, progress=die)
    resumed = train_segmentation(TINY, *examples, folder=tmp_path)
    assert same(resumed.network, whole.network)
    assert without_seconds(resumed.log) == without_seconds(whole.log)
    assert without_seconds(read_log(tmp_path / "log.jsonl")) == without_seconds(whole.log)
    finished = train_segmentation(TINY, *examples, folder=tmp_path, progress=die)  # no step left to die in
    assert same(finished.network, whole.network)


def test_a_training_starts_from_a_trained_network_and_leaves_it_alone(tmp_path, whole, examples):
    before = copy.deepcopy(whole.network)
    gentle = changed(n_epochs=1, learning_rate=1e-5)
    found = train_segmentation(gentle, *examples, folder=tmp_path, start=whole.network)
    assert same(whole.network, before)
    assert not same(found.network, before)
    gap = max(float((a - b).detach().abs().max()) for a, b in zip(found.network.parameters(), before.parameters()))
    assert gap < 1e-4  # three steps of Adam, each at most about the learning rate
    fresh = train_segmentation(gentle, *examples)
    checks = [[line for line in each.log if "validation_loss" in line][-1] for each in (found, fresh)]
    assert checks[0]["validation_loss"] < checks[1]["validation_loss"]


def test_a_training_from_another_start_is_another_training(tmp_path, whole, examples):
    short = changed(n_epochs=1)
    train_segmentation(short, *examples, folder=tmp_path, start=whole.network)
    refuses("start_sha256", train_segmentation, short, *examples, folder=tmp_path)


@pytest.mark.parametrize(
    ("network", "message"),
    [
        ({"width": 8, "depth": 2, "fold": 2}, "has width 8, and this training has 4: take --set network.width=8, or"),
        (
            {"width": 4, "depth": 2, "fold": 2, "placement": "white matter"},
            r"placement 'white matter'.*make-cohort --st",
        ),
    ],
)
def test_a_start_of_another_architecture_is_refused(examples, network, message):
    refuses(message, train_segmentation, TINY, *examples, start=SegmentationNetwork(**network))


@pytest.mark.parametrize("soft", [True, False])
def test_ordering_and_targets_are_settings(examples, whole, soft):
    other = train_segmentation(changed(seed=1, soft_labels=soft, n_epochs=1, batch_size=2), *examples)
    assert not same(other.network, whole.network)
    assert [line["step"] for line in other.log if "loss" in line] == [1, 2]


def test_a_state_of_another_training_is_refused(tmp_path, examples):
    train_segmentation(changed(n_epochs=1), *examples, folder=tmp_path)
    refuses("made with another training", train_segmentation, changed(n_epochs=1, seed=9), *examples, folder=tmp_path)
    with pytest.raises(ValueError, match="made with another data"):
        train_segmentation(changed(n_epochs=1), examples[0][:2], examples[1], folder=tmp_path)


def test_examples_must_be_there_and_alike(examples):
    for training, validation in (([], examples[1]), (examples[0], [])):
        refuses("at least one of each is needed", train_segmentation, TINY, training, validation)
    with pytest.raises(ValueError, match=r"on grids \[\(16, 12, 12\), \(32, 24, 24\)\]; all must be on one grid"):
        train_segmentation(TINY, examples[0], phantom_examples(1, reduction=2))


def test_the_configurations_of_the_package_are_read():
    for name in ("tiny", "small", "paper"):
        config = read_segmentation_config(name)
        assert json.loads(json.dumps(config.as_dict()))["training"]["n_epochs"] > 0
    assert (config.training.learning_rate, config.training.schedule, config.training.n_epochs) == (
        1e-4,
        "constant",
        100,
    )
    refuses("the package has paper, people, small, tiny", read_segmentation_config, "none")


def test_a_trained_network_finds_the_sides_and_their_surfaces(examples):
    whole_voxels = {"width": 6, "depth": 3, "fold": 1}
    config = SegmentationConfig.read(
        {"network": whole_voxels, "training": vars(changed(n_epochs=8, learning_rate=0.005).training)}
    )
    training = train_segmentation(config, *examples)
    last = training.log[-1]
    assert min(last["dice_left"], last["dice_right"]) > 0.85
    surfaces = phantom_surfaces(99)
    found = segment(phantom_scan(surfaces, 99).volume, training.network)
    assert all(part.data.min() >= 0 and part.data.max() <= 1 for part in found.values())
    places = [np.argwhere(found[side].data > 0.5)[:, 0].mean() for side in ("left", "right")]
    assert places[0] < 12 < 20 < places[1]
    meshes = initial_surfaces(phantom_scan(surfaces, 99), training.network)
    for side, true in surfaces.items():
        centre = meshes[side].mesh.vertices.mean(dim=0) - true.vertices.mean(dim=0)
        assert float(centre.norm()) < 0.5


def test_every_step_sees_another_variant_and_every_epoch_another_order(examples):
    thrice = 3 * examples[0][:1]  # so that the steps of one epoch differ in nothing else
    images = [_batch(step, thrice, TINY.training)[1] for step in range(6)]
    assert not any(torch.equal(one, other) for one, other in itertools.combinations(images, 2))
    assert torch.equal(_batch(4, thrice, TINY.training)[1], images[4])
    assert not torch.equal(_batch(4, thrice, changed(seed=1).training)[1], images[4])
    orders = [tuple(_batch(3 * epoch + i, examples[0], TINY.training)[0][0] for i in range(3)) for epoch in range(8)]
    assert len(set(orders)) > 2
    assert all(set(order) == {"phantom-0", "phantom-1", "phantom-2"} for order in orders)
