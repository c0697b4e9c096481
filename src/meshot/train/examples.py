"""Examples of a training: which ones a step uses, and their record."""

from collections.abc import Callable, Sequence

import numpy as np

_ORDER = 0  # random number stream; a training has the streams from 1


def require_examples(training: Sequence, validation: Sequence) -> None:
    """Check that there are examples for training and for validation.

    Raises
    ------
    ValueError
        If one of the two is empty.
    """
    if not training or not validation:
        raise ValueError(
            f"{len(training)} examples for training and {len(validation)} for validation came; at least one of each is "
            "needed"
        )


def examples_of_step(step: int, n_examples: int, seed: int, batch_size: int = 1) -> list[int]:
    """The indices of the training examples of a step. Every epoch visits all examples in a new random order.

    Parameters
    ----------
    step, n_examples, seed : int
    batch_size : int
        Number of examples in a step. The last step of an epoch has fewer if ``n_examples`` is not a multiple of it.
    """
    epoch, place = divmod(step, -(-n_examples // batch_size))
    order = np.random.default_rng([seed, _ORDER, epoch]).permutation(n_examples)
    return order[place * batch_size : (place + 1) * batch_size].tolist()


def data_record(training: Sequence, validation: Sequence, digest: Callable[[Sequence], str]) -> dict:
    """The number of examples for training and validation, and a digest of each set."""
    parts = (("training", training), ("validation", validation))
    return {name: {"n_scans": len(part), "sha256": digest(part)} for name, part in parts}
