"""What the toys share: settings of one group, and a training of so many steps."""

from collections.abc import Callable
from pathlib import Path

import torch

from meshot.settings import checked_groups
from meshot.systems import Part, SurfaceSystem
from meshot.train import Plan, Progress, Task, train_network

DEFAULTS = {"n_steps": 30, "learning_rate": 0.1}


class Toy(SurfaceSystem):
    """A system with two settings."""

    @classmethod
    def complete(cls, settings: dict) -> dict:
        return {"training": DEFAULTS | checked_groups(settings, {"training": set(DEFAULTS)}, cls.name)["training"]}

    @classmethod
    def trained(
        cls, part: str, network: torch.nn.Module, loss: Callable, validate: Callable, settings: dict,
        folder: Path | None, progress: Progress | None,
    ) -> Part:  # fmt: skip
        """One part, trained on ``loss()`` and validated by ``validate()``."""
        plan = Plan(settings["training"]["n_steps"], 10, 5, None, settings["training"]["learning_rate"], "cosine")
        found = train_network(
            network, plan,
            Task(lambda _: (loss(), "all"), lambda _: {"validation_loss": float(validate().detach())}), settings,
            None if folder is None else folder / part, progress,
        )  # fmt: skip
        return Part(found.network, settings | {"results": found.results()}, found.log)
