"""The protocol of a system: training, saving, loading, and reconstruction of surfaces from a scan."""

import abc
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import torch
from torch import nn

from meshot.mesh import Mesh
from meshot.model import write_weights
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey, listed
from meshot.systems.parts import Part, read_part
from meshot.train import Groups, Progress, require_examples
from meshot.types import PLACEMENTS, Placement


class SurfaceSystem(abc.ABC):
    """A trained system. Subclasses define the method; an object also has the weights.

    A subclass sets ``name``, ``surfaces``, ``needs`` and ``networks``, and defines :meth:`complete`,
    :meth:`train_parts` and :meth:`find_surfaces`. If its surfaces depend on its settings, it defines
    :meth:`surfaces_of` and :meth:`parts_of`, and does not set ``surfaces``.

    Parameters
    ----------
    parts : mapping
        Trained networks by name, see ``networks``. The settings in their records say which surfaces they are for.

    Attributes
    ----------
    name : str
        The name in the registry.
    surfaces : tuple of keys
        The surfaces that :meth:`reconstruct` of this object finds. Before a training, ask :meth:`surfaces_of`.
    needs : tuple of keys
        The initial surfaces that the system requires. Empty, for example, for a template or an implicit surface.
    networks : mapping
        The class of each network that the system can have, by the name of the part. It must have a method ``config``
        that returns the arguments of the class.
    placement : str
        How scans must be placed on the standard grid for this object: as those of its training were.

    Raises
    ------
    ValueError
        If the parts are for different surfaces or placements, or one has a name that the system does not have.
    """

    name: ClassVar[str]
    surfaces: tuple[SurfaceKey, ...]
    needs: ClassVar[tuple[SurfaceKey, ...]] = ()
    networks: ClassVar[Mapping[str, type[nn.Module]]]

    def __init__(self, parts: Mapping[str, Part]):
        records = {name: part.record for name, part in parts.items()} or {"": {}}
        first, *others = records
        self.surfaces, self._needed = self.surfaces_of(records[first]), self.parts_of(records[first])
        strange = sorted(parts.keys() - set(self._needed))
        if strange:
            raise ValueError(f"{self.name} has no part {', '.join(strange)}; its parts are {', '.join(self._needed)}")
        for name in others:
            found = self.surfaces_of(records[name])
            if found != self.surfaces:
                raise ValueError(
                    f"{first} of {self.name} was trained for {listed(self.surfaces)}, and {name} for {listed(found)}; "
                    "all parts must be for the same surfaces: take those of one training"
                )
        placements = {
            name: record.get("results", {}).get("placement", PLACEMENTS[0]) for name, record in records.items()
        }
        self.placement: Placement = placements[first]
        if len(set(placements.values())) > 1:
            each = ", ".join(f"{name} by {placement}" for name, placement in placements.items())
            raise ValueError(
                f"scans were placed differently for the parts of {self.name}: {each}; train all on one cohort"
            )
        self.parts = dict(parts)

    @classmethod
    def surfaces_of(cls, settings: Mapping) -> tuple[SurfaceKey, ...]:
        """The surfaces that a training with these settings is for. The examples must contain them.

        By default ``surfaces`` of the class.

        Parameters
        ----------
        settings : mapping
            By group, or the record of a part, which has them. Missing settings have their defaults.

        Raises
        ------
        ValueError
            If the settings name no surfaces that the system can find.
        """
        return cls.surfaces

    @classmethod
    def parts_of(cls, settings: Mapping) -> tuple[str, ...]:
        """The names of the networks of a system with these settings, by default of all ``networks``.

        The first is the same for all settings.

        Parameters
        ----------
        settings : mapping
            As in :meth:`surfaces_of`.
        """
        return tuple(cls.networks)

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
        cls._require_examples(examples, cls.surfaces_of(settings))
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
        missing = [name for name in self._needed if name not in self.parts]
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
            If a part is missing, damaged, belongs to another system or part, or is for other surfaces than the first.
        """

        def read(name: str) -> Part:
            return read_part(Path(folder) / f"{name}.safetensors", cls.networks[name], cls.name, needed)

        needed = cls.parts_of({})
        parts = {name: read(name) for name in needed[:1]}
        for part in parts.values():  # the record of the first part says which others there are
            needed = cls.parts_of(part.record)
        return cls(parts | {name: read(name) for name in needed[1:]})

    @classmethod
    def _require_examples(cls, examples: ExampleSets, surfaces: Sequence[SurfaceKey]) -> None:
        require_examples(examples.training, examples.validation)
        for example in (*examples.training, *examples.validation):
            cls._require_initial(example.scan, example.name)
            missing = [key for key in surfaces if key not in example.targets]
            if missing:
                raise ValueError(f"{example.name} has no true surface {listed(missing)}; {cls.name} learns from it")

    @classmethod
    def _require_initial(cls, scan: Scan, name: str) -> None:
        missing = [key for key in cls.needs if key not in scan.initial]
        if missing:
            raise ValueError(f"{name} has no initial surface {listed(missing)}; {cls.name} starts from it: make one")
        strange = [key for key in scan.initial if key not in cls.needs]
        if strange:
            raise ValueError(f"{name} has an initial surface {listed(strange)}; {cls.name} takes none: leave it out")
