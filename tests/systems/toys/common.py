"""What the toys share: settings of one group, and a training of so many steps."""

import dataclasses
from collections.abc import Callable

import torch

from meshot.settings import Count, Positive, Settings
from meshot.systems import Part, Run, SurfaceSystem
from meshot.train import Plan, Task, train_network


@dataclasses.dataclass(frozen=True)
class Training(Settings):
    """The settings of the training."""

    n_steps: Count = 30
    learning_rate: Positive = 0.1


@dataclasses.dataclass(frozen=True)
class Groups(Settings):
    """All settings."""

    training: Training


class Toy(SurfaceSystem):
    """A system with two settings."""

    groups = Groups

    @classmethod
    def trained(
        cls, part: str, network: torch.nn.Module, loss: Callable, validate: Callable, settings: Groups, run: Run
    ) -> Part:
        """One part, trained on ``loss()`` and validated by ``validate()``."""
        plan = Plan(settings.training.n_steps, 10, 5, None, settings.training.learning_rate, "cosine")
        task = Task(lambda _: (loss(), "all"), lambda _: {"validation_loss": float(validate().detach())})
        found = train_network(network, plan, task, settings.as_dict(), run.place(part), run.progress)
        return Part(found.network, settings.as_dict() | {"results": found.results()}, found.log)
