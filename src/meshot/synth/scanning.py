"""Simulation of one scan of one subject, with its ground truth, in scanner RAS and on the standard grid."""

import dataclasses
import functools
import json
import math
from collections.abc import Mapping

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from meshot.anatomy import mni152_t1, placed_by_white_matter
from meshot.files import write_whole
from meshot.mesh import Mesh, face_areas, self_intersecting_faces, signed_volume, write_mesh
from meshot.rng import Generator, numpy_generator
from meshot.settings import Settings
from meshot.synth import cohorts as cohort
from meshot.synth.heads import CarriedHead, Leaves
from meshot.synth.imaging import (
    SAME_SIGNAL,
    SULCI_MM,
    Appearance,
    Blemishes,
    Ellipsoids,
    blemished,
    moved_structure,
    structures_of,
    t1_image,
    tissue_fractions,
)
from meshot.synth.subject import CorticalSurfaces
from meshot.types import Array, Float, Tensor
from meshot.volume import (
    StandardScan,
    Volume,
    enclosed_fractions,
    standard_scan,
    transform_points,
    volume_pyramid,
    write_volume,
)

# Random position of a head in the scanner, and the grid of the image.

_AXES = {"R": (0, 1), "L": (0, -1), "A": (1, 1), "P": (1, -1), "S": (2, 1), "I": (2, -1)}


@dataclasses.dataclass(frozen=True)
class Position(Settings):
    """Parameters of the random position of a head, and of the grid.

    Parameters
    ----------
    rotation_degrees : float
        Maximum rotation of the head about each axis.
    translation_mm : float
        Maximum translation of the head along each axis.
    oblique_degrees : float
        Maximum rotation of the grid about each axis.
    voxel_mm : three numbers
        Voxel sizes along the axes of the grid.
    orientation : str
        Directions of the three axes of the grid, up to the oblique rotation: three of the letters R or L, A or P, S or
        I.
    margin_mm : float
        Distance by which the grid exceeds the head.

    Raises
    ------
    ValueError
        If a number is out of range, or the letters do not specify three axes.
    """

    rotation_degrees: float = 8.0
    translation_mm: float = 10.0
    oblique_degrees: float = 0.0
    voxel_mm: tuple[float, float, float] = (1.0, 1.0, 1.0)
    orientation: str = "RAS"
    margin_mm: float = 10.0

    def __post_init__(self):
        angles = (self.rotation_degrees, self.oblique_degrees)
        if not all(0 <= angle <= 30 for angle in angles) or not 0 <= self.translation_mm <= 100:
            raise ValueError(
                f"rotations are up to {angles} degrees and the translation up to {self.translation_mm} mm; 0 to 30 "
                "degrees (the registration finds no more) and 0 to 100 mm are needed"
            )
        if len(self.voxel_mm) != 3 or not all(0.3 <= size <= 10 for size in self.voxel_mm):
            raise ValueError(f"voxel_mm is {self.voxel_mm}; three sizes from 0.3 to 10 mm are needed")
        if not 0 <= self.margin_mm <= 100:
            raise ValueError(f"margin_mm is {self.margin_mm}; 0 to 100 mm are needed")
        axes = [_AXES[letter][0] for letter in str(self.orientation) if letter in _AXES]
        if len(str(self.orientation)) != 3 or sorted(axes) != [0, 1, 2]:
            raise ValueError(
                f"orientation is {self.orientation!r}; one letter of each of the pairs RL, AP, SI is needed, such as "
                "RAS, LAS or PIR"
            )


def head_position(position: Position, centre_mm: Float[Array, " 3"], generator: Generator) -> Float[Array, "4 4"]:
    """A random rigid motion from head coordinates to scanner RAS, in mm, with rotation about ``centre_mm``."""
    rng = numpy_generator(generator)
    motion = np.eye(4)
    motion[:3, :3] = _rotation(position.rotation_degrees, rng)
    shift = position.translation_mm * rng.uniform(-1, 1, 3)
    motion[:3, 3] = centre_mm + shift - motion[:3, :3] @ centre_mm
    return motion


def scanner_grid(position: Position, points_mm: Float[Tensor, "n 3"], generator: Generator) -> Volume:
    """An empty volume that contains all points with a margin, in the orientation of ``position``."""
    axes = np.zeros((3, 3))
    for column, letter in enumerate(position.orientation):
        axis, sign = _AXES[letter]
        axes[axis, column] = sign
    axes = _rotation(position.oblique_degrees, numpy_generator(generator)) @ axes
    sizes = np.array(position.voxel_mm, dtype=np.float64)
    along = points_mm.detach().double().cpu().numpy() @ axes
    low = np.floor((along.min(axis=0) - position.margin_mm) / sizes)
    shape = (np.ceil((along.max(axis=0) + position.margin_mm) / sizes) - low + 1).astype(int)
    affine = np.eye(4)
    affine[:3, :3] = axes * sizes
    affine[:3, 3] = axes @ (low * sizes)
    # A file header stores 32-bit numbers; use the same values in the computation.
    return Volume(np.zeros(shape.tolist(), dtype=np.uint8), affine.astype(np.float32).astype(np.float64))


def _rotation(degrees: float, rng: np.random.Generator) -> Float[Array, "3 3"]:
    return Rotation.from_euler("xyz", degrees * rng.uniform(-1, 1, 3), degrees=True).as_matrix()


#: Written coordinates (mm) and values are multiples of these. This removes last bits, which differ between CPUs.
VERTEX_STEP, STANDARD_STEP = 2.0**-14, 2.0**-12
_LEAVES, _BLEMISHES = 1, 2  # appended to the seed of a scan


@dataclasses.dataclass(frozen=True)
class Anatomy:
    """Parameters of a head other than those of its cortical surfaces.

    Parameters
    ----------
    ventricles : float
        Half axes of the ventricles, relative to those of a young adult; 0 for none.
    below : float
        The same for cerebellum and brainstem.
    head_mm : tuple
        Thickness of fluid, skull and scalp, in mm; empty for none.
    n_lines : int
        Number of lines across each voxel for partial volumes.
    leaf_mm : float, optional
        If given, everything outside the cortex is taken from the MNI152 average and deformed with the cortex, and the
        leaves of the cerebellum have this width. ``below`` is then not used. None for ellipsoids.
    sulci_mm : float, optional
        The largest width of a sulcus with fluid, for a brain in air: see :func:`meshot.synth.tissue_fractions`.
    blemishes : Blemishes, optional
        Lesions, vessels, and errors of skull stripping.

    Raises
    ------
    ValueError
        If ``leaf_mm`` is given together with a size ``below`` other than 1.
    """

    ventricles: float = 1.0
    below: float = 1.0
    head_mm: tuple[float, ...] = ()
    n_lines: int = 3
    leaf_mm: float | None = None
    sulci_mm: float | None = None
    blemishes: Blemishes | None = None

    def __post_init__(self):
        if self.leaf_mm is not None and self.below != 1.0:
            raise ValueError(f"below is {self.below}; with leaf_mm the average has its own size: leave out below")


@dataclasses.dataclass(frozen=True, eq=False)
class Scan:
    """A scan and its ground truth, in scanner RAS."""

    image: Volume  # T1-weighted, integers in arbitrary units
    tissue: Volume  # see meshot.synth.LABELS
    surfaces: Mapping[tuple[str, str], Mesh]  # by ("white" or "pial", "left" or "right")
    head_to_scanner: Float[Array, "4 4"]  # the rigid motion from head coordinates to scanner RAS


def simulated_scan(
    subject: CorticalSurfaces, anatomy: Anatomy, appearance: Appearance, position: Position, seed: list[int]
) -> Scan:
    """Simulate a scan: place the head in the scanner, compute the tissue fractions, and make the image.

    The subject is in head coordinates. The seed is that of the position, the grid, and the image.
    """
    rng = np.random.default_rng(seed)
    corners = torch.cat([mesh.vertices.detach() for mesh in subject.pial.values()])
    centre = ((corners.amin(dim=0) + corners.amax(dim=0)) / 2).double().numpy()
    motion = head_position(position, centre, rng)
    surfaces = {
        (kind, side): Mesh(
            (transform_points(motion, mesh.vertices.detach().double()) / VERTEX_STEP).round() * VERTEX_STEP, mesh.faces
        )
        for kind, meshes in (("white", subject.white), ("pial", subject.pial))
        for side, mesh in meshes.items()
    }
    if anatomy.leaf_mm is None:
        structures = structures_of(subject.white, anatomy.ventricles, anatomy.below)
        inner = Ellipsoids([moved_structure(structure, motion) for structure in structures])
    elif subject.warp is None:
        raise ValueError("the subject has no warp to carry the average with; make it with synthetic_subject")
    else:
        inner = CarriedHead(subject.warp, motion, anatomy.ventricles, Leaves(anatomy.leaf_mm), [*seed, _LEAVES])
    corners = [mesh.vertices for (kind, _), mesh in surfaces.items() if kind == "pial"]
    room = dataclasses.replace(position, margin_mm=position.margin_mm + sum(anatomy.head_mm))
    grid = scanner_grid(room, torch.cat([*corners, inner.ends()]), rng)
    white, pial = ([surfaces[kind, side] for side in ("left", "right")] for kind in ("white", "pial"))
    sulci = SULCI_MM if anatomy.sulci_mm is None else anatomy.sulci_mm
    fractions = tissue_fractions(white, pial, grid, anatomy.head_mm, anatomy.n_lines, inner, sulci)
    if anatomy.blemishes is not None:
        fractions = blemished(fractions, grid, anatomy.blemishes, np.random.default_rng([*seed, _BLEMISHES]))
    image = t1_image(fractions, grid, appearance, rng)
    whole = image.with_data(np.clip(np.rint(image.data), 0, 32767).astype(np.int16))
    # The tissue with the largest fraction of each voxel, or air.
    left, right = (enclosed_fractions(mesh, grid, 1) for mesh in pial)
    on_right = right > left
    hindbrain = sum((fractions[t] for t in SAME_SIGNAL if t in fractions), fractions["hindbrain"])
    fractions = {t: part for t, part in fractions.items() if t not in SAME_SIGNAL} | {"hindbrain": hindbrain}
    most, labels = 1 - sum(fractions.values()), np.zeros(grid.data.shape, dtype=np.uint8)
    for tissue, part in fractions.items():
        sided = tissue in ("white", "grey")
        value = np.uint8(cohort.LABELS[f"left {tissue}" if sided else tissue])
        labels = np.where(part > most, value + on_right if sided else value, labels)
        most = np.maximum(part, most)
    return Scan(whole, Volume(labels, grid.affine), surfaces, motion)


@functools.cache
def _template(size: int) -> Volume:
    return volume_pyramid(mni152_t1(), size.bit_length())[-1]


def standardised(
    scan: Scan, registration_mm: int = 1, seed: int = 0, by_white_matter: bool = False
) -> tuple[StandardScan, Volume]:
    """The scan on the standard grid (the paper's preprocessing), and the labels of both white surfaces.

    Parameters
    ----------
    scan : Scan
    registration_mm : int
        Voxel size of the average to which the scan is registered, a power of two. Above 1, registration is faster and
        less accurate.
    seed : int
        Seed of the registration.
    by_white_matter : bool
        Whether the true white matter then places the scan, see :func:`meshot.anatomy.placed_by_white_matter`.
    """
    placed = standard_scan(scan.image, _template(registration_mm), seed)
    if by_white_matter:
        placed = placed_by_white_matter(scan.image, placed, _white_labels(scan, placed))
    volume = placed.volume.with_data((np.rint(placed.volume.data / STANDARD_STEP) * STANDARD_STEP).astype(np.float32))
    return dataclasses.replace(placed, volume=volume), _white_labels(scan, placed)


def _white_labels(scan: Scan, placed: StandardScan) -> Volume:
    """1 (left) or 2 (right) where the white surface encloses at least half of a voxel, else 0."""
    labels = np.zeros(placed.volume.data.shape, dtype=np.uint8)
    for label, side in enumerate(("left", "right"), start=1):
        white = scan.surfaces["white", side]
        white = white.with_vertices(placed.from_scanner(white.vertices))
        labels[enclosed_fractions(white, placed.volume) >= 0.5] = label
    return placed.volume.with_data(labels)


def surface_facts(scan: Scan, subject: CorticalSurfaces) -> dict:
    """Area (cm²), enclosed volume (ml) and intersecting faces of every surface, and quantiles of thickness in mm."""
    facts = {}
    for (kind, side), mesh in scan.surfaces.items():
        facts[f"{side} {kind}"] = {
            "area_cm2": rounded(float(face_areas(mesh).sum()) / 100),
            "volume_ml": rounded(float(signed_volume(mesh)) / 1000),
            "crossing_faces": len(self_intersecting_faces(mesh)),
        }
    for side in subject.white:
        quantiles = np.quantile(subject.thickness(side)[~subject.wall[side]].numpy(), (0.05, 0.5, 0.95))
        facts[f"{side} thickness_mm"] = {
            name: rounded(q) for name, q in zip(("p5", "median", "p95"), quantiles, strict=True)
        }
    return facts


def rounded(value: object) -> object:
    """Numbers rounded to six digits, in nested containers, because last bits differ between CPUs and change hashes."""
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


def write_scan(place: cohort.Subject, scan: Scan, standard: tuple[StandardScan, Volume], facts: dict) -> None:
    """Write all files of a scan at the paths where the cohort is read."""
    write_volume(place.file(cohort.T1), scan.image)
    write_volume(place.file(cohort.TISSUE), scan.tissue)
    for (kind, side), mesh in scan.surfaces.items():
        write_mesh(place.file(cohort.SURFACE.format(side[0].upper(), kind)), mesh)
    placed, labels = standard
    write_volume(place.file(cohort.STANDARD_T1, standard=True), placed.volume)
    write_volume(place.file(cohort.STANDARD_LABELS, standard=True), labels)
    about = {"from": "scanner RAS, mm", "to": "MNI152, mm", "matrix": placed.to_standard.tolist()}
    _write_json(place.file(cohort.TRANSFORM, standard=True), about)
    _write_json(place.file(cohort.FACTS), facts)


def _write_json(path: object, content: dict) -> None:
    write_whole(path, json.dumps(content, indent=1, ensure_ascii=False) + "\n")
