"""Plans: epochs in steps."""

import dataclasses

from meshot.train import TrainingSettings

SETTINGS = TrainingSettings(10, 0.1, "cosine", validate_every=2, patience=3, save_every=7, averaging=0.5)


def test_epochs_become_steps():
    plan = SETTINGS.plan(5)
    assert (plan.n_steps, plan.validate_every) == (50, 10)
    same = dataclasses.asdict(SETTINGS).items() - {("n_epochs", 10), ("validate_every", 2), ("seed", 0)}
    assert {(name, getattr(plan, name)) for name, _ in same} == same


def test_the_last_batch_of_an_epoch_is_a_step():
    pairs = type("Pairs", (TrainingSettings,), {"batch_size": 2})
    plan = pairs(**dataclasses.asdict(SETTINGS)).plan(5)
    assert (plan.n_steps, plan.validate_every) == (30, 6)
