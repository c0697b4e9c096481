"""The protocol of a system: training, saving, loading, and reconstruction of surfaces from a scan."""

import abc
import dataclasses
import os
import reprlib
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import torch
from torch import nn

from meshot.mesh import Mesh
from meshot.model import read_weights, write_weights
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey
from meshot.train import Groups, Progress, require_examples


@dataclasses.dataclass(frozen=True, eq=False)
class Part:
    """One trained network of a system.

    Parameters
    ----------
    network : module
    record : dict
        JSON values: the settings, and the results of the training under ``results``.
    log : list of dict
        The log of the training. Empty if the network was read from a file.
    """

    network: nn.Module
    record: dict = dataclasses.field(default_factory=dict)
    log: list[dict] = dataclasses.field(default_factory=list)


class SurfaceSystem(abc.ABC):
    """A trained system. Subclasses define the method; an object also has the weights.

    A subclass sets ``name``, ``surfaces``, ``needs`` and ``networks``, and defines :meth:`complete`,
    :meth:`train_parts` and :meth:`find_surfaces`.

    Parameters
    ----------
    parts : mapping
        Trained networks by name, see ``networks``.

    Attributes
    ----------
    name : str
        The name in the registry.
    surfaces : tuple of keys
        The surfaces that :meth:`reconstruct` finds. The examples of a training must contain them.
    needs : tuple of keys
        The initial surfaces that the system requires. Empty, for example, for a template or an implicit surface.
    networks : mapping
        The class of each network, by the name of the part. It must have a method ``config`` that returns the arguments
        of the class.

    Raises
    ------
    ValueError
        If a part has a name that the system does not have.
    """

    name: ClassVar[str]
    surfaces: ClassVar[tuple[SurfaceKey, ...]]
    needs: ClassVar[tuple[SurfaceKey, ...]] = ()
    networks: ClassVar[Mapping[str, type[nn.Module]]]

    def __init__(self, parts: Mapping[str, Part]):
        strange = sorted(parts.keys() - self.networks)
        if strange:
            raise ValueError(f"{self.name} has no part {', '.join(strange)}; its parts are {', '.join(self.networks)}")
        self.parts = dict(parts)

    @classmethod
    @abc.abstractmethod
    def complete(cls, settings: Groups) -> Groups:
        """All settings of a training: the given ones, and defaults for the others.

        Raises
        ------
        ValueError
            If a setting is unknown, a value is invalid, or a network is too large to be stored.
        """

    @classmethod
    @abc.abstractmethod
    def train_parts(
        cls, examples: ExampleSets, settings: Groups, folder: Path | None, progress: Progress | None,
        device: torch.device | None,
    ) -> dict[str, Part]:  # fmt: skip
        """Train with complete settings. Called by :meth:`train`."""

    @abc.abstractmethod
    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The surfaces in a scan that has been checked. Called by :meth:`reconstruct`."""

    @classmethod
    def train(
        cls,
        examples: ExampleSets,
        settings: Groups,
        folder: str | os.PathLike | None = None,
        progress: Progress | None = None,
        device: torch.device | None = None,
    ) -> "SurfaceSystem":
        """Train the system, or resume a stopped training.

        Parameters
        ----------
        examples : ExampleSets
        settings : dict
            By group, as in a YAML file.
        folder : path, optional
            The folder for the states of the training. A stopped training resumes from it. On one CPU thread, the final
            weights are the same as without the interruption.
        progress : callable of (steps done, number of steps, line of the log), optional
        device : torch.device, optional
            By default the GPU if there is one, else the CPU.

        Raises
        ------
        ValueError
            If a setting is invalid, there are no examples, an example lacks a surface, or the folder contains a
            different training.
        FloatingPointError
            If a loss or a gradient is not finite.
        """
        settings = cls.complete(settings)
        cls._require_examples(examples)
        return cls(cls.train_parts(examples, settings, None if folder is None else Path(folder), progress, device))

    def reconstruct(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """Find the surfaces in a scan, by key, in the space of its image, in mm.

        Raises
        ------
        ValueError
            If the scan lacks an initial surface that the system needs, or has one that it does not use; or if a part
            is not trained.
        """
        self._require_initial(scan, "the scan")
        missing = [name for name in self.networks if name not in self.parts]
        if missing:
            raise ValueError(
                f"{self.name} has no trained {', '.join(missing)}, only {', '.join(self.parts) or 'nothing'}: train "
                "what is missing"
            )
        return self.find_surfaces(scan)

    def save(self, folder: str | os.PathLike) -> None:
        """Write every part with its record to ``PART.safetensors`` in a folder. Other files there do not change.

        Raises
        ------
        ValueError
            As :func:`meshot.model.write_weights`.
        """
        for name, part in self.parts.items():
            write_weights(
                Path(folder) / f"{name}.safetensors", part.network, part.record | {"system": self.name, "part": name}
            )

    @classmethod
    def load(cls, folder: str | os.PathLike) -> "SurfaceSystem":
        """Load a system that was written by :meth:`save`.

        Raises
        ------
        ValueError
            If a part is missing, damaged, or belongs to another system or part.
        """
        return cls({name: cls._read_part(Path(folder) / f"{name}.safetensors") for name in cls.networks})

    @classmethod
    def _read_part(cls, path: Path) -> Part:
        if not path.is_file():
            raise ValueError(
                f"{path} is missing; {cls.name} needs {', '.join(cls.networks)}: name a folder that holds them "
                f"(--weights), or train them (meshot train {cls.name})"
            )
        network, record = read_weights(path, cls.networks[path.stem])
        for group in ("training", "results"):
            if not isinstance(record.get(group, {}), dict):
                raise ValueError(
                    f"{path} has {reprlib.repr(record[group])} as its {group}; names and values are needed"
                )
        if record.get("system", cls.name) != cls.name:
            raise ValueError(
                f"{path} holds weights of the system {record['system']}; {cls.name} was asked for: take --system "
                f"{record['system']}, or other weights"
            )
        if record.get("part", path.stem) != path.stem:
            raise ValueError(f"{path} holds {record['part']} of {cls.name}; {path.stem} is needed: rename it")
        return Part(network, record)

    @classmethod
    def _require_examples(cls, examples: ExampleSets) -> None:
        require_examples(examples.training, examples.validation)
        for example in (*examples.training, *examples.validation):
            cls._require_initial(example.scan, example.name)
            missing = [key for key in cls.surfaces if key not in example.targets]
            if missing:
                raise ValueError(f"{example.name} has no true surface {_listed(missing)}; {cls.name} learns from it")

    @classmethod
    def _require_initial(cls, scan: Scan, name: str) -> None:
        missing = [key for key in cls.needs if key not in scan.initial]
        if missing:
            raise ValueError(f"{name} has no initial surface {_listed(missing)}; {cls.name} starts from it: make one")
        strange = [key for key in scan.initial if key not in cls.needs]
        if strange:
            raise ValueError(f"{name} has an initial surface {_listed(strange)}; {cls.name} takes none: leave it out")


def _listed(keys: list[SurfaceKey]) -> str:
    return ", ".join(" ".join(key) for key in keys)
