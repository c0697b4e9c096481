"""The protocol of systems that find surfaces in a scan: inputs, training, weights, and the registry."""

import abc
import dataclasses
import importlib
import json
import os
import pkgutil
import reprlib
from collections.abc import Mapping, Sequence
from importlib.metadata import entry_points
from importlib.resources import files
from pathlib import Path
from typing import ClassVar

import torch
from torch import nn

import meshot.systems
from meshot.anatomy import Hemisphere
from meshot.mesh import Mesh
from meshot.model import read_weights, require_small, write_weights
from meshot.settings import Settings, read_groups
from meshot.train import Progress, chosen_device, require_examples
from meshot.types import PLACEMENTS, Placement
from meshot.volume import Volume

#: The key of a surface: hemisphere and name, such as ``("left", "white")``.
SurfaceKey = tuple[Hemisphere, str]


def listed(keys: Sequence[SurfaceKey]) -> str:
    """Surfaces in words, such as ``left white, right white``."""
    return ", ".join(" ".join(key) for key in keys)


@dataclasses.dataclass(frozen=True, eq=False)
class Scan:
    """The input of a system for one subject.

    Parameters
    ----------
    image : Volume
        On the standard grid, in [0, 1].
    initial : mapping
        Initial surfaces by key, in the space of the image, in mm. Empty if the system needs none.
    """

    image: Volume
    initial: Mapping[SurfaceKey, Mesh] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, eq=False)
class Example:
    """A subject with known true surfaces.

    Parameters
    ----------
    name : str
    scan : Scan
    targets : mapping
        True surfaces by key, in the space of the image, in mm.
    """

    name: str
    scan: Scan
    targets: Mapping[SurfaceKey, Mesh]


@dataclasses.dataclass(frozen=True, eq=False)
class ExampleSets:
    """The examples of a training, and those of its validation."""

    training: Sequence[Example]
    validation: Sequence[Example]


@dataclasses.dataclass(frozen=True, eq=False)
class Run:
    """How a training runs: its networks before the first step, where its states are kept, what it tells, and where."""

    networks: Mapping[str, nn.Module] = dataclasses.field(default_factory=dict)
    folder: Path | None = None
    progress: Progress | None = None
    device: torch.device = dataclasses.field(default_factory=chosen_device)

    def place(self, part: str) -> Path | None:
        """The folder of the state of a part."""
        return None if self.folder is None else self.folder / part


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


# The protocol of a system: training, saving, loading, and reconstruction of surfaces from a scan.


class SurfaceSystem(abc.ABC):
    """A trained system. Subclasses define the method; an object also has the weights.

    A subclass sets ``name``, ``groups``, ``surfaces``, ``needs`` and ``networks``, and defines :meth:`train_parts` and
    :meth:`find_surfaces`. If its surfaces depend on its settings, it defines :meth:`surfaces_of` and :meth:`parts_of`,
    and does not set ``surfaces``.

    Parameters
    ----------
    parts : mapping
        Trained networks by name, see ``networks``. The settings in their records say which surfaces they are for.

    Attributes
    ----------
    name : str
        The name in the registry.
    groups : class
        The settings of a training: a dataclass of ``meshot.settings.Settings``, with a field for each group.
    surfaces : tuple of keys
        The surfaces that :meth:`reconstruct` of this object finds. Before a training, ask :meth:`surfaces_of`.
    needs : tuple of keys
        The initial surfaces that the system requires. Empty, for example, for a template or an implicit surface.
    networks : mapping
        The class of each network that the system can have, by the name of the part. It must have a method ``config``
        that returns the arguments of the class.
    settings : dict
        The settings of each part, from its record, but for ``network`` and ``loss``, which only a training needs.
    placement : str
        How scans must be placed on the standard grid for this object: as those of its training were.

    Raises
    ------
    ValueError
        If the parts are for different surfaces or placements, or one has a name that the system does not have.
    """

    name: ClassVar[str]
    groups: ClassVar[type[Settings]] = Settings
    surfaces: tuple[SurfaceKey, ...]
    needs: ClassVar[tuple[SurfaceKey, ...]] = ()
    networks: ClassVar[Mapping[str, type[nn.Module]]]

    def __init__(self, parts: Mapping[str, Part]):
        self.settings = {name: self._recorded(name, part.record) for name, part in parts.items()}
        first = next(iter(parts), None)
        settings = self.settings.get(first) or self.complete({})
        self.surfaces, self._needed = self.surfaces_of(settings), self.parts_of(settings)
        strange = sorted(parts.keys() - set(self._needed))
        if strange:
            raise ValueError(f"{self.name} has no part {', '.join(strange)}; its parts are {', '.join(self._needed)}")
        for name, settings in self.settings.items():
            found = self.surfaces_of(settings)
            if found != self.surfaces:
                raise ValueError(
                    f"{first} of {self.name} was trained for {listed(self.surfaces)}, and {name} for {listed(found)}; "
                    "all parts must be for the same surfaces: take those of one training"
                )
        placements: dict[str, Placement] = {
            name: part.record.get("results", {}).get("placement", PLACEMENTS[0]) for name, part in parts.items()
        }
        self.placement = placements.get(first, PLACEMENTS[0])
        if len(set(placements.values())) > 1:
            each = ", ".join(f"{name} by {placement}" for name, placement in placements.items())
            raise ValueError(
                f"scans were placed differently for the parts of {self.name}: {each}; train all on one cohort"
            )
        self.parts = dict(parts)

    @classmethod
    def _recorded(cls, name: str, record: Mapping) -> Settings:
        groups = {group: record[group] for group in cls.groups.kinds().keys() & record.keys() - {"network", "loss"}}
        return cls.groups.read(groups, f"the record of {name} of {cls.name}")

    @classmethod
    def surfaces_of(cls, settings: Settings) -> tuple[SurfaceKey, ...]:
        """The surfaces that a training with these settings is for, by default ``surfaces``.

        The examples must contain them.
        """
        return cls.surfaces

    @classmethod
    def parts_of(cls, settings: Settings) -> tuple[str, ...]:
        """The names of the networks of a system with these settings, by default of all ``networks``.

        The first is the same for all settings.
        """
        return tuple(cls.networks)

    @classmethod
    def complete(cls, settings: Settings | Mapping[str, object]) -> Settings:
        """All settings of a training: the given ones, by group, and defaults for the others.

        Raises
        ------
        ValueError
            If a setting is unknown, or a value is invalid.
        """
        return cls.groups.read(settings, f"the configuration of {cls.name}")

    @classmethod
    def new_networks(cls, settings: Settings) -> dict[str, nn.Module]:
        """The networks before the first step, by the name of the part. Called by :meth:`prepare`.

        By default none: :meth:`train_parts` makes them, for example if they depend on the examples.
        """
        return {}

    @classmethod
    def prepare(cls, settings: Settings) -> dict[str, nn.Module]:
        """The networks of a training before the first step. Call it before the examples are read.

        Raises
        ------
        ValueError
            If no network can have these settings, or it is too large to be stored.
        """
        try:
            networks = cls.new_networks(settings)
            for network in networks.values():
                require_small(network)
        except ValueError as error:
            raise ValueError(f"the configuration of {cls.name} is invalid: {error}") from error
        return networks

    @classmethod
    @abc.abstractmethod
    def train_parts(cls, examples: ExampleSets, settings: Settings, run: Run) -> dict[str, Part]:
        """Train with complete settings. Called by :meth:`train`."""

    @abc.abstractmethod
    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The surfaces in a scan that has been checked. Called by :meth:`reconstruct`."""

    @classmethod
    def train(
        cls,
        examples: ExampleSets,
        settings: Settings | Mapping[str, object],
        folder: str | os.PathLike | None = None,
        progress: Progress | None = None,
        device: torch.device | None = None,
        networks: Mapping[str, nn.Module] | None = None,
    ) -> "SurfaceSystem":
        """Train the system, or resume a stopped training.

        Parameters
        ----------
        examples : ExampleSets
        settings : Settings or dict
            From :func:`meshot.systems.read_settings`, or by group, as in a YAML file.
        folder : path, optional
            The folder for the states of the training. A stopped training resumes from it. On one CPU thread, the final
            weights are the same as without the interruption.
        progress : callable of (steps done, number of steps, line of the log), optional
        device : torch.device, optional
            By default the GPU if there is one, else the CPU.
        networks : mapping, optional
            From :meth:`prepare`, which this method calls otherwise. They are trained.

        Raises
        ------
        ValueError
            If a setting is invalid, there are no examples, an example lacks a surface, or the folder contains a
            different training.
        FloatingPointError
            If a loss or a gradient is not finite.
        """
        settings = cls.complete(settings)
        require_examples(examples.training, examples.validation)
        for example in (*examples.training, *examples.validation):
            cls._require_initial(example.scan, example.name)
            missing = [key for key in cls.surfaces_of(settings) if key not in example.targets]
            if missing:
                raise ValueError(f"{example.name} has no true surface {listed(missing)}; {cls.name} learns from it")
        networks = cls.prepare(settings) if networks is None else networks
        place = None if folder is None else Path(folder)
        return cls(cls.train_parts(examples, settings, Run(networks, place, progress, device or chosen_device())))

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

    def with_white_only(self) -> "SurfaceSystem":
        """The same without the parts that find other surfaces from the white ones, if there are such.

        Raises
        ------
        ValueError
            If white and other surfaces are found together.
        """
        if any(kind != "white" for _, kind in self.surfaces):
            raise ValueError(
                f"{self.name} finds white and pial surfaces together, by one network: leave --white-only out, or use "
                "weights that were trained for white surfaces only"
            )
        return self

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

        needed = cls.parts_of(cls.complete({}))
        first = needed[0]
        parts = {first: cls.read_part(folder, first, needed)}
        needed = cls.parts_of(cls._recorded(first, parts[first].record))  # it says which others there are
        return cls(parts | {name: cls.read_part(folder, name, needed) for name in needed[1:]})

    @classmethod
    def read_part(cls, folder: str | os.PathLike, name: str, needed: Sequence[str] = ()) -> Part:
        """One trained network with its record from the folder of a system, of all that are needed. For :meth:`load`."""
        path = Path(folder) / f"{name}.safetensors"
        if not path.is_file():
            raise ValueError(
                f"{path} is missing; {cls.name} needs {', '.join(needed) or name}: name a folder that holds them "
                f"(--weights), or train them (meshot train {cls.name})"
            )
        network, record = read_weights(path, cls.networks[name])
        if not isinstance(record.get("results", {}), dict):
            found = reprlib.repr(record["results"])
            raise ValueError(f"{path} has {found} as its results; names and values are needed")
        if record.get("system", cls.name) != cls.name:
            raise ValueError(
                f"{path} holds weights of the system {record['system']}; {cls.name} was asked for: take --system "
                f"{record['system']}, or other weights"
            )
        if record.get("part", name) != name:
            raise ValueError(f"{path} holds {record['part']} of {cls.name}; {name} is needed: rename it")
        return Part(network, record)

    @classmethod
    def _require_initial(cls, scan: Scan, name: str) -> None:
        missing = [key for key in cls.needs if key not in scan.initial]
        if missing:
            raise ValueError(f"{name} has no initial surface {listed(missing)}; {cls.name} starts from it: make one")
        strange = [key for key in scan.initial if key not in cls.needs]
        if strange:
            raise ValueError(f"{name} has an initial surface {listed(strange)}; {cls.name} takes none: leave it out")


# The registry of systems: those in this folder, and those that other packages register as entry points.

#: The entry point group for systems of other packages.
GROUP = "meshot.systems"


def system_names() -> list[str]:
    """The names of all systems, sorted."""
    return sorted(_systems())


def get_system(name: str) -> type[SurfaceSystem]:
    """The class of a system.

    Raises
    ------
    ValueError
        If no system has that name.
    """
    known = _systems()
    if name not in known:
        raise ValueError(f"there is no system {name!r}; known are {', '.join(sorted(known))}")
    return known[name]


def read_settings(kind: type[SurfaceSystem], config: str | os.PathLike, changes: Sequence[str] = ()) -> Settings:
    """The complete settings of a training.

    Parameters
    ----------
    kind : class
        For example ``get_system("ddot")``.
    config : path or str
        A YAML file, or the name of a configuration of the system, such as ``small``.
    changes : sequence of str
        Settings that replace those of the file, such as ``training.seed=1``.

    Raises
    ------
    ValueError
        If the file or configuration does not exist, it is not YAML, or a value is invalid.
    """
    # The configurations of the package by name: in the folder of a system that is a package, or in settings/NAME.
    path, packaged, module = Path(config), {}, importlib.import_module(kind.__module__)
    if hasattr(module, "__path__") or module.__package__:
        is_package = hasattr(module, "__path__")
        folder = files(module) if is_package else files(module.__package__) / "settings" / kind.name
        found = folder.iterdir() if folder.is_dir() else ()
        packaged = {file.name.removesuffix(".yaml"): file for file in found if file.name.endswith(".yaml")}
    if path.suffix not in (".yaml", ".yml"):
        if str(config) not in packaged:
            raise ValueError(
                f"{kind.name} has no setting {str(config)!r}; it has {', '.join(sorted(packaged)) or 'none'}, or name "
                "a YAML file"
            )
        path = packaged[str(config)]
    try:
        return kind.complete(read_groups(path, changes))
    except ValueError as error:
        raise ValueError(f"{config}: {error}") from error


def _systems() -> dict[str, type[SurfaceSystem]]:
    found = {}
    for entry in pkgutil.iter_modules(meshot.systems.__path__, "meshot.systems."):
        module = importlib.import_module(entry.name)
        for kind in vars(module).values():
            if isinstance(kind, type) and issubclass(kind, SurfaceSystem) and "name" in vars(kind):
                found[kind.name] = kind
    return found | {entry.name: entry.load() for entry in entry_points(group=GROUP) if entry.name not in found}


# The trained weights in the package, and the default system.

#: The folder of the weights: a subfolder for each system, and ``manifest.json`` with the name of the default.
SHIPPED = Path(__file__).parent.parent / "weights"
MANIFEST = "manifest.json"


def default_system() -> str:
    """The name of the default system."""
    return json.loads((SHIPPED / MANIFEST).read_text(encoding="utf-8"))["default_system"]


def load_system(name: str | None = None, folder: str | os.PathLike | None = None) -> SurfaceSystem:
    """Load a trained system by its name, by default that of the package.

    The folder was written by :meth:`meshot.systems.SurfaceSystem.save`. By default it is that of the package.

    Raises
    ------
    ValueError
        If the system is unknown, there are no weights for it, or they belong to another system.
    """
    kind = get_system(default_system() if name is None else name)
    shipped = SHIPPED / kind.name
    if folder is None and not shipped.is_dir():
        raise ValueError(
            f"no weights of {kind.name} come with the package: train it (meshot train {kind.name} CONFIG --data COHORT "
            f"-o FOLDER) and name the folder (--weights FOLDER), or put them into {shipped.name}/ of the package's "
            "weights"
        )
    return kind.load(shipped if folder is None else folder)
