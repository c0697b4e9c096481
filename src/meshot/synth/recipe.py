"""Recipes of cohorts: YAML files with checked parameters, and random draws from them for each subject."""

import dataclasses
import math
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated

import numpy as np

from meshot.extras import needing
from meshot.files import named_file
from meshot.settings import Count, Length, Natural, Settings, Share, one_of, read_yaml
from meshot.synth.cohorts import KINDS, SPLITS, Participant
from meshot.synth.imaging import TISSUES, Appearance, Blemishes
from meshot.synth.scanning import Anatomy, Position
from meshot.synth.subject import Shape
from meshot.types import PLACEMENTS, Placement

# Variation between people in the manner of real data sets: age, skull, voxels, contrast, blemishes.

Range = tuple[float, float]


def _ordered(least: float, words: str) -> object:
    """A range whose ends are ordered, from ``least`` on."""

    def check(ends: Range, name: str) -> Range:
        if not least <= ends[0] <= ends[1]:
            raise ValueError(f"{name} is {list(ends)}; a range [low, high] {words} is needed")
        return ends

    return Annotated[tuple[float, float], check]


AboveZero = _ordered(math.nextafter(0, 1), "above 0")


@dataclasses.dataclass(frozen=True)
class People(Settings):
    """How the people of a cohort and their scans differ. A pair is a range from which a number is drawn for each.

    Parameters
    ----------
    thickness, atrophy, ventricles : pair of float
        The value at the youngest and at the oldest age: see :class:`meshot.synth.Shape` and
        :class:`meshot.synth.Anatomy`. One age is drawn for all three.
    recess : pair of float
        A distance in mm by which the white surface is moved inwards and the cortex becomes thicker, whatever the age.
        The white matter of fsaverage5's gyri is thicker than that of a person, since fsaverage5 is an average.
    leaf_mm, sulci_mm : pair of float
        See :class:`meshot.synth.Anatomy`.
    voxel_mm : pair of float
        Voxel sizes. Half of the scans have voxels of one size along all axes.
    orientations : tuple of str
        One is drawn for each scan.
    skull_share : float
        The share of the scans with skull and scalp.
    skull_mm : pair of float
        A factor on ``layers_mm``.
    layers_mm : tuple of float
        Thickness of fluid, skull and scalp.
    dura, cut, lesions : float
        The largest shares of these blemishes: see :class:`meshot.synth.Blemishes`. Scans with a skull have
        neither dura nor cuts.
    vessels : int
        The largest number of vessels.
    """

    thickness: Range = (2.6, 2.2)
    atrophy: Range = (0.0, 0.4)
    recess: _ordered(0, "from 0 on") = (0.0, 0.0)
    ventricles: Range = (0.9, 1.9)
    leaf_mm: AboveZero = (3.0, 4.5)
    sulci_mm: AboveZero = (4.0, 14.0)
    voxel_mm: AboveZero = (0.7, 1.5)
    orientations: tuple[str, ...] = ("RAS", "LAS", "PSR", "LIA")
    skull_share: Share = 0.5
    skull_mm: AboveZero = (0.8, 1.3)
    layers_mm: tuple[float, float, float] = (3.0, 6.0, 5.0)
    dura: float = 0.25
    cut: float = 0.1
    lesions: float = 0.05
    vessels: int = 12

    def __post_init__(self):
        super().__post_init__()
        Blemishes(dura=self.dura, cut=self.cut, lesions=self.lesions, vessels=self.vessels)
        for letters in self.orientations:
            Position(orientation=letters)


def drawn_person(variation: People, shape: Shape, position: Position, seed: int) -> tuple[Shape, Anatomy, Position]:
    """One person: the anatomy of the cortex, that of the rest of the head, and the parameters of the position."""
    rng = np.random.default_rng([seed, 5])
    age = rng.uniform()

    def at_age(ends: Range) -> float:
        return float(ends[0] + age * (ends[1] - ends[0]))

    def between(ends: Range) -> float:
        return float(rng.uniform(*ends))

    mirrored, has_skull = bool(rng.integers(2)), bool(rng.uniform() < variation.skull_share)
    sizes = [between(variation.voxel_mm) for _ in range(3)]
    voxel = tuple(sizes[:1] * 3 if rng.integers(2) else sizes)
    letters = variation.orientations[rng.integers(len(variation.orientations))]
    layers = tuple(between(variation.skull_mm) * thickness for thickness in variation.layers_mm)
    shares = {name: getattr(variation, name) * float(rng.uniform()) for name in ("dura", "cut", "lesions")}
    if has_skull:
        shares |= {"dura": 0.0, "cut": 0.0}
    anatomy = Anatomy(
        ventricles=at_age(variation.ventricles),
        head_mm=layers if has_skull else (),
        n_lines=2,
        leaf_mm=between(variation.leaf_mm),
        sulci_mm=between(variation.sulci_mm),
        blemishes=Blemishes(**shares, vessels=int(rng.integers(variation.vessels + 1))),
    )
    recess = between(variation.recess)
    thickness, atrophy = at_age(variation.thickness) + recess, at_age(variation.atrophy) + recess
    shape = dataclasses.replace(shape, thickness=thickness, atrophy=atrophy, mirrored=mirrored)
    return shape, anatomy, dataclasses.replace(position, voxel_mm=voxel, orientation=letters)


with needing("cortex"):
    import yaml

_HELD_OUT = "held out"  # a random number stream of its own
_EXTRAS = {"ventricles": (0.0, 3.0), "below": (0.0, 3.0)}


@dataclasses.dataclass(frozen=True)
class Recipe(Settings):
    """The complete description of a cohort.

    Parameters
    ----------
    name : str
    seed : int
    subjects, procedural_subjects : int
        Number of subjects made from the template, and made without it. The latter are all in the test split.
    held_out_subjects : int
        Number of further subjects made from the template, all in the test split. They leave the other subjects and
        their splits as they are, so that trained networks stay comparable.
    split : mapping
        Fractions of the template subjects, by ``SPLITS``, with sum one.
    days, scans_per_day : int
        If both are 1, each subject is scanned once. Otherwise there is a session per day, and every scan has its own
        position, grid, texture, bias field and noise.
    shape, procedural_shape : mapping
        Parameters of :class:`meshot.synth.Shape`.
    appearance : mapping
        Parameters of :class:`meshot.synth.Appearance`: numbers, or ranges from which one is drawn for each subject.
    position : mapping
        Parameters of :class:`meshot.synth.Position`.
    structures : mapping
        ``ventricles`` and ``below``, see :class:`meshot.synth.Anatomy`: numbers or ranges.
    head_mm : tuple
        Thickness of fluid, skull and scalp around the brain, in mm. Empty for a brain without skull.
    n_lines : int
        Number of lines across each voxel for partial volumes.
    registration_mm : int
        Voxel size of the MNI152 average to which scans are registered: 1; or 2, 4, 8 for tests.
    standard : str
        "grey values", or "white matter" to place scans by it: :func:`meshot.anatomy.placed_by_white_matter`.
    leaf_mm : float, optional
        Take the head outside the cortex from the MNI152 average: see :class:`meshot.synth.Anatomy`.
    people : mapping
        Parameters of :class:`meshot.synth.People`. If any is given, age, voxels, skull and blemishes
        vary between people, and replace what the other entries say of them.

    Raises
    ------
    ValueError
        If a number is out of range, or a parameter is unknown.
    """

    name: str
    seed: Natural
    subjects: Natural = 40
    procedural_subjects: Natural = 0
    held_out_subjects: Natural = 0
    split: Mapping[str, float] = dataclasses.field(default_factory=lambda: dict(zip(SPLITS, (0.7, 0.1, 0.2))))
    days: Count = 1
    scans_per_day: Count = 1
    shape: Mapping[str, object] = dataclasses.field(default_factory=dict)
    procedural_shape: Mapping[str, object] = dataclasses.field(default_factory=dict)
    appearance: Mapping[str, object] = dataclasses.field(default_factory=dict)
    position: Mapping[str, object] = dataclasses.field(default_factory=dict)
    structures: Mapping[str, object] = dataclasses.field(default_factory=dict)
    head_mm: tuple[Length, ...] = ()
    n_lines: Count = 3
    registration_mm: Annotated[int, one_of((1, 2, 4, 8))] = 1
    standard: Placement = PLACEMENTS[0]
    leaf_mm: float | None = None
    people: Mapping[str, object] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        super().__post_init__()
        _require_known(self.split, SPLITS, "split")
        if not all(_is_number(x) and x >= 0 for x in self.split.values()) or abs(sum(self.split.values()) - 1) > 1e-9:
            raise ValueError(f"split is {dict(self.split)}; parts >= 0 that sum to one are needed")
        if len(self.head_mm) not in (0, 3):
            raise ValueError(f"head_mm is {list(self.head_mm)}; three thicknesses > 0 or none are needed")
        _require_known(self.structures, _EXTRAS, "structures")
        People.read(self.people, "people")
        drawn_shape(self, "template"), drawn_shape(self, "procedural"), drawn_position(self)
        for end in (0, 1):  # if both ends of a range are valid, so are the values between them
            _appearance(self.appearance, lambda value: _range(value)[end])  # noqa: B023
            for name, (low, high) in _EXTRAS.items():
                value = _range(self.structures.get(name, 1.0))[end]
                if not low <= value <= high:
                    raise ValueError(f"structures: {name} is {value}; {low} to {high} is needed")


def read_recipe(path: str | os.PathLike, **changes: object) -> Recipe:
    """Read a recipe from a YAML file, with some of its entries replaced.

    Parameters
    ----------
    path : path
        The file, or the name of a recipe in the package: oasis_like, adni_like, test_retest,
        people_like, tiny.
    changes
        Entries that replace those of the file.

    Raises
    ------
    ValueError
        If the file is missing or not YAML, or has unknown entries; otherwise as :class:`Recipe`.
    """
    path = named_file(path, Path(__file__).parent / "recipes")
    if not path.is_file():
        raise ValueError(f"{path} does not exist; name a YAML file, or a recipe of the package, such as tiny")
    entries = read_yaml(path)
    if isinstance(entries, dict):
        entries = {key: value for key, value in entries.items() if value is not None} | changes
    return Recipe.read(entries, str(path))


def recipe_text(recipe: Recipe) -> str:
    """A recipe as YAML text. Reading it gives the same recipe."""
    return yaml.safe_dump(recipe.as_dict(), sort_keys=False, allow_unicode=True)


def plan(recipe: Recipe) -> list[Participant]:
    """The participants of a cohort. A larger number of subjects does not change the first ones."""
    # Each subject is assigned to the split whose share is furthest below its target. Every multiple of ten subjects is
    # therefore divided exactly. The order introduces no bias, since every subject is drawn independently.
    counts, found = dict.fromkeys(SPLITS, 0), []
    for i in range(recipe.subjects):
        split = max(SPLITS, key=lambda s: recipe.split.get(s, 0.0) * (i + 1) - counts[s])
        counts[split] += 1
        found.append(Participant(f"sub-{i + 1:03d}", split, "template", _seed(recipe, "template", i)))
    for i in range(recipe.held_out_subjects):
        found.append(Participant(f"sub-h{i + 1:02d}", "test", "template", _seed(recipe, _HELD_OUT, i)))
    for i in range(recipe.procedural_subjects):
        found.append(Participant(f"sub-p{i + 1:02d}", "test", "procedural", _seed(recipe, "procedural", i)))
    return found


def _seed(recipe: Recipe, stream: str, index: int) -> int:
    number = [*KINDS, _HELD_OUT].index(stream)
    return int(np.random.SeedSequence([recipe.seed, number, index]).generate_state(1)[0])


def drawn_shape(recipe: Recipe, kind: str) -> Shape:
    """The parameters of the anatomy. Variation between subjects is drawn together with the surfaces."""
    knobs = recipe.shape if kind == "template" else recipe.procedural_shape
    _require_known(knobs, Shape.kinds().keys() - {"kind"}, "shape")
    return Shape.read({"kind": kind} | dict(knobs), "shape")


def drawn_appearance(recipe: Recipe, seed: int) -> Appearance:
    """The image parameters of one subject: tissue signals and artefacts, drawn from the recipe's ranges."""
    rng = np.random.default_rng([seed, 1])
    return _appearance(recipe.appearance, lambda value: float(rng.uniform(*_range(value))))


def drawn_structures(recipe: Recipe, seed: int) -> dict[str, float]:
    """The sizes of the inner structures of one subject."""
    rng = np.random.default_rng([seed, 2])
    return {name: float(rng.uniform(*_range(recipe.structures.get(name, 1.0)))) for name in _EXTRAS}


def drawn_position(recipe: Recipe) -> Position:
    """The parameters of the position. They are bounds; the position of each scan is drawn within them."""
    return Position.read(recipe.position, "position")


def _appearance(knobs: Mapping[str, object], draw: Callable[[object], float]) -> Appearance:
    _require_known(knobs, Appearance.kinds(), "appearance")
    signal = knobs.get("signal")
    if not isinstance(signal, Mapping):
        raise ValueError(f"appearance: signal is {signal!r}; a number or a range for each of {', '.join(TISSUES)}")
    signal = {tissue: draw(value) for tissue, value in sorted(signal.items())}
    return Appearance(**{"signal": signal} | {k: draw(v) for k, v in sorted(knobs.items()) if k != "signal"})


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _range(value: object) -> Range:
    ends = value if isinstance(value, list | tuple) else (value, value)
    if len(ends) != 2 or not all(map(_is_number, ends)) or ends[0] > ends[1]:
        raise ValueError(f"{value!r} is neither a number nor a range [low, high]")
    return float(ends[0]), float(ends[1])


def _require_known(entries: object, known: Iterable[str], where: str) -> None:
    if not isinstance(entries, Mapping):
        raise ValueError(f"{where} holds {entries!r}; entries such as 'knob: number' are needed")
    unknown = sorted(str(k) for k in entries if k not in known)
    if unknown:
        raise ValueError(f"{where} names {', '.join(unknown)}, which is unknown; known are {', '.join(sorted(known))}")
