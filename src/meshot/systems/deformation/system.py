"""Systems that deform initial white surfaces by flows, with one network per hemisphere."""

import dataclasses
from pathlib import Path
from typing import ClassVar

import torch

from meshot.anatomy import HEMISPHERES
from meshot.loss.composed import loss_setting_names
from meshot.mesh import Mesh
from meshot.model import N_STEPS, DeformationNetwork, require_small
from meshot.systems.deformation.carrying import deformed
from meshot.systems.deformation.data import hemisphere_example
from meshot.systems.deformation.settings import DeformationConfig, deformation_config
from meshot.systems.deformation.training import train_deformation
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey
from meshot.systems.parts import Part
from meshot.systems.protocol import SurfaceSystem
from meshot.train import Groups, Progress

_KEYS = tuple((side, "white") for side in HEMISPHERES)


class DeformationSystem(SurfaceSystem):
    """A system that deforms initial white surfaces. A subclass sets ``name`` and ``loss``.

    Attributes
    ----------
    loss : dict
        Default settings of the loss, in the format of ``loss`` in a YAML file.
    """

    surfaces = needs = _KEYS
    networks = {"_".join(key): DeformationNetwork for key in _KEYS}  # noqa: RUF012 (of the class, by the protocol)
    loss: ClassVar[dict] = {}

    @classmethod
    def config(cls, settings: Groups) -> DeformationConfig:
        """The settings as an object.

        Raises
        ------
        ValueError
            If a setting is unknown, a value is invalid, or the network is too large to be stored.
        """
        loss = cls._loss_settings(settings.get("loss", {}))
        config = deformation_config(settings | {"loss": loss}, f"the configuration of {cls.name}")
        require_small(config.new_network())
        return config

    @classmethod
    def _loss_settings(cls, given: dict) -> dict:
        """The given settings of the loss, with those defaults of the system that the loss and the encoding use."""
        chosen = {"terms", "loss", "encoding"} & given.keys()
        if "terms" in chosen or "terms" in cls.loss:
            return given if chosen else cls.loss | given
        names = {name: given.get(name) or cls.loss[name] for name in ("loss", "encoding")}
        return {k: v for k, v in cls.loss.items() if k in loss_setting_names(**names)} | names | given

    @classmethod
    def complete(cls, settings: Groups) -> Groups:
        """All settings with their defaults: see :class:`meshot.systems.deformation.DeformationConfig`."""
        return cls.config(settings).as_dict()

    @classmethod
    def train_parts(
        cls, examples: ExampleSets, settings: Groups, folder: Path | None, progress: Progress | None,
        device: torch.device | None,
    ) -> dict[str, Part]:  # fmt: skip
        """Train a network for the side in the settings, or for both sides, one after the other."""
        config, parts = cls.config(settings), {}
        for side in config.training.sides:
            name, training = f"{side}_white", dataclasses.replace(config.training, side=side)
            own = dataclasses.replace(config, training=training)
            sets = (
                [hemisphere_example(example, side, training.n_faces) for example in part]
                for part in (examples.training, examples.validation)
            )
            found = train_deformation(own, *sets, None if folder is None else folder / name, progress, device)
            parts[name] = Part(found.network, own.as_dict() | {"results": found.results()}, found.log)
        return parts

    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The initial surfaces moved by the flows, integrated with the settings of the training."""
        found = {}
        for key in self.surfaces:
            part = self.parts["_".join(key)]
            training = {"n_flow_steps": N_STEPS, "method": "euler"} | part.record.get("training", {})
            found[key] = deformed(
                scan.initial[key], scan.image, part.network, training["n_flow_steps"], training["method"]
            )
        return found
