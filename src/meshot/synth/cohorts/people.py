"""Variation between people in the manner of real data sets: age, skull, voxels, contrast, blemishes."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from meshot.synth.blemishes import Blemishes
from meshot.synth.position import Position
from meshot.synth.scanning import Anatomy
from meshot.synth.subject import Shape

#: A number, or the two ends of a range.
Range = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class People:
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

    Raises
    ------
    ValueError
        If a range is not ordered, or a share is outside [0, 1].
    """

    thickness: Range = (2.6, 2.2)
    atrophy: Range = (0.0, 0.4)
    recess: Range = (0.0, 0.0)
    ventricles: Range = (0.9, 1.9)
    leaf_mm: Range = (3.0, 4.5)
    sulci_mm: Range = (4.0, 14.0)
    voxel_mm: Range = (0.7, 1.5)
    orientations: tuple[str, ...] = ("RAS", "LAS", "PSR", "LIA")
    skull_share: float = 0.5
    skull_mm: Range = (0.8, 1.3)
    layers_mm: tuple[float, float, float] = (3.0, 6.0, 5.0)
    dura: float = 0.25
    cut: float = 0.1
    lesions: float = 0.05
    vessels: int = 12

    def __post_init__(self):
        for name in ("leaf_mm", "sulci_mm", "voxel_mm", "skull_mm"):
            low, high = getattr(self, name)
            if not 0 < low <= high:
                raise ValueError(f"people: {name} is {[low, high]}; a range [low, high] above 0 is needed")
        if not 0 <= self.recess[0] <= self.recess[1]:
            raise ValueError(f"people: recess is {list(self.recess)}; a range [low, high] from 0 on is needed")
        if not 0 <= self.skull_share <= 1:
            raise ValueError(f"people: skull_share is {self.skull_share!r}; a share in [0, 1] is needed")
        Blemishes(dura=self.dura, cut=self.cut, lesions=self.lesions, vessels=self.vessels)
        for letters in self.orientations:
            Position(orientation=letters)


def people(entries: Mapping[str, object]) -> People:
    """The variation from the entries of a recipe.

    Raises
    ------
    ValueError
        If an entry is unknown or has another structure.
    """
    known = {field.name for field in dataclasses.fields(People)}
    unknown = sorted(str(key) for key in entries if key not in known)
    if unknown:
        raise ValueError(f"people names {', '.join(unknown)}, which is unknown; known are {', '.join(sorted(known))}")
    try:
        return People(**{key: tuple(v) if isinstance(v, list) else v for key, v in entries.items()})
    except (TypeError, ValueError) as error:
        raise ValueError(f"people holds {dict(entries)}: {error}") from error


def drawn_person(variation: People, shape: Shape, position: Position, seed: int) -> tuple[Shape, Anatomy, Position]:
    """One person: the anatomy of the cortex, that of the rest of the head, and the parameters of the position.

    Parameters
    ----------
    variation : People
    shape, position : Shape, Position
        Of the recipe. What varies between people is replaced.
    seed : int
    """
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
        ventricles=at_age(variation.ventricles), head_mm=layers if has_skull else (), n_lines=2,
        leaf_mm=between(variation.leaf_mm), sulci_mm=between(variation.sulci_mm),
        blemishes=Blemishes(**shares, vessels=int(rng.integers(variation.vessels + 1))),
    )  # fmt: skip
    recess = between(variation.recess)
    thickness, atrophy = at_age(variation.thickness) + recess, at_age(variation.atrophy) + recess
    shape = dataclasses.replace(shape, thickness=thickness, atrophy=atrophy, mirrored=mirrored)
    return shape, anatomy, dataclasses.replace(position, voxel_mm=voxel, orientation=letters)
