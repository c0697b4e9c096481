"""Examples of a training: every epoch visits all of them, in the order of its own random numbers."""

import numpy as np
import pytest

from meshot.train.engine import data_record, examples_of_step, require_examples
from refusals import refuses


@pytest.mark.parametrize("batch_size", [1, 2, 3, 7])
def test_every_epoch_visits_all_examples_once(batch_size):
    per_epoch, epochs = -(-7 // batch_size), []
    for epoch in range(3):
        batches = [examples_of_step(epoch * per_epoch + place, 7, 4, batch_size) for place in range(per_epoch)]
        assert all(len(batch) == batch_size for batch in batches[:-1])
        epochs.append([index for batch in batches for index in batch])
        assert sorted(epochs[-1]) == list(range(7))
        assert epochs[-1] == np.random.default_rng([4, 0, epoch]).permutation(7).tolist()
    assert epochs[0] != epochs[1]


def test_the_seed_decides_the_order():
    first, second = ([examples_of_step(step, 9, seed) for step in range(9)] for seed in (0, 1))
    assert first != second


@pytest.mark.parametrize(("training", "validation"), [([], [1]), ([1], [])])
def test_both_sets_are_needed(training, validation):
    require_examples([1], [1])
    words = f"{len(training)} examples for training and {len(validation)} for validation came; at least one of each"
    refuses(words, require_examples, training, validation)


def test_the_record_counts_and_digests_both_sets():
    assert data_record("abc", "d", lambda part: part * 2) == {
        "training": {"n_scans": 3, "sha256": "abcabc"},
        "validation": {"n_scans": 1, "sha256": "dd"},
    }
