"""Plans: epochs in steps."""

import types

from meshot.train.engine import plan_of_epochs

SETTINGS = {
    "n_epochs": 10, "validate_every": 2, "save_every": 7, "patience": 3, "learning_rate": 0.1, "schedule": "cosine",
    "averaging": 0.5,
}  # fmt: skip


def test_epochs_become_steps():
    plan = plan_of_epochs(types.SimpleNamespace(**SETTINGS), 5)
    assert (plan.n_steps, plan.validate_every) == (50, 10)
    same = {name: value for name, value in SETTINGS.items() if name not in ("n_epochs", "validate_every")}
    assert {name: getattr(plan, name) for name in same} == same


def test_the_last_batch_of_an_epoch_is_a_step():
    plan = plan_of_epochs(types.SimpleNamespace(**SETTINGS, batch_size=2), 5)
    assert (plan.n_steps, plan.validate_every) == (30, 6)
