"""Warnings about a scan and its reconstruction: a name, a value and a sentence each.

A warning is a sign of failure, not a proof. A failure may come without a warning.

There are two sets of rules. Where scans are placed by the white matter that a network finds, as for the networks of the
package, numbers of the finished reconstruction are compared with :data:`LIMITS`, which ``experiments/warnings`` chose.
Where scans are placed by their grey values, the ranges below are used. They were measured on a person's scan, the
MNI152 average and a synthetic scan, and on versions of them that must fail: halves, a foetus-sized head, a head with
its skull, inverted contrast, a mask, noise, and imitations of an angiogram and of a CT.
"""

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.ndimage import binary_erosion, label

from meshot.file_facts import FileFacts
from meshot.files import printable_name
from meshot.flow import RepairedSurface
from meshot.mesh import Mesh, face_areas, self_intersecting_faces, signed_volume, vertex_normals
from meshot.metrics import vertex_distances
from meshot.pipeline.initial_surface import SegmentedSurface
from meshot.types import Array, Bool, Float
from meshot.volume import StandardScan, Volume, bright_volume, resample, sample_volume, voxel_sizes

if TYPE_CHECKING:
    from meshot.pipeline.reconstruction import HemisphereSurface

#: Scans of the synthetic cohorts reach .79 to .84; upside down, back to front or with inverted contrast, .71.
LOWEST_AGREEMENT = 0.75
#: Correlation with the template inside its brain: good scans have .4 to 1; a head that is inverted, upside down or with
#: its skull, a CT and an angiogram have −.5 to .26.
LOWEST_CONTRAST = 0.3
#: Where the template is brighter than this share of its largest value, its brain is; its rim is left out.
BRAIN_SHARE, RIM_VOXELS = 0.2, 3
#: A voxel is empty below this share of what is bright inside the brain.
EMPTY_SHARE = 0.02
#: The largest piece of the template's brain where the scan is empty, in cm³: a person's scan has 0.01, most synthetic
#: heads at most 0.3, one with a deep cut of the skull stripping 10; the person without the lowest 10, 20 and 30 mm has
#: 6, 41 and 96.
LARGEST_GAP_CM3 = 15.0
#: Volume of the bright voxels, in cm³: whole brains have 690 to 1870, halves at most 695, heads with their skull 1970.
BRIGHT_CM3 = (700.0, 1950.0)
#: The largest of the three scales of the registration over the smallest: good scans have at most 1.09, most halves 1.35
#: to 2.8.
LARGEST_STRETCH = 1.2
#: Different values of a scan; masks and label images have fewer.
FEWEST_VALUES = 16
#: Heads differ from the template by less, in each direction on average.
SCALES = (0.75, 1.33)
#: What the white surface of one adult hemisphere may enclose, ventricles and basal ganglia included, in cm³.
VOLUMES_CM3 = (120.0, 450.0)
#: Clean segmentations lose about one hundredth on the way to genus 0.
LARGEST_LOSS = 0.03
#: Of the faces, after a flow: on heads for validation the shipped kind of flow leaves up to two hundredths.
LARGEST_CROSSING = 0.03
#: The same, of a surface that no repair follows.
LARGEST_LEFT_CROSSING = 0.005
#: The area over that of the segmentation's surface: the shipped flow has 1.25 on the MNI152 average.
AREAS = (0.8, 2.5)
#: The larger of the mean distances from surface to segmentation and back, in mm: the shipped flow has .3 mm on a
#: synthetic head, and .6 on the MNI152 average.
LARGEST_DISTANCE_MM = 1.2
#: The largest distance by which the repair may move a vertex without a warning, in mm. On these heads it is up to 7 mm.
LARGEST_REPAIR_MM = 8.0
#: Correlation with the template inside its brain. The template has 1.00, also after registration, and .98 with blur and
#: noise of 2 %; the synthetic head in the repository has .50.
HIGHEST_CONTRAST = 0.97

#: By these names tables and records know the warnings.
WarningName = Literal[
    "few_values",
    "bright_volume",
    "agreement",
    "contrast",
    "gap",
    "stretch",
    "scale",
    "mirrored",
    "placement",
    "voxel_size",
    "surface_volume",
    "sides",
    "border",
    "voxels_given_up",
    "surface_area",
    "segmentation_distance",
    "crossing_faces",
    "group_average",
    "long_echo_time",
    "unreadable_sidecar",
    "same_file_twice",
    "file",
]


@dataclasses.dataclass(frozen=True)
class QualityWarning:
    """A sign of failure of a scan or its reconstruction; as text, its sentence.

    Parameters
    ----------
    name : str
        Short, for tables.
    text : str
        What was found, what is usual, and what to look at.
    value : float, optional
        What was found, as a number in the unit of the text. None if it is no number.
    """

    name: WarningName
    text: str
    value: float | None = None

    def __str__(self) -> str:
        return self.text


class DoubtfulScanError(ValueError):
    """A scan, or what was found in it, looks so odd that a strict reconstruction stops."""

    exit_status = 3


def require_no_warnings(found: Iterable[QualityWarning]) -> None:
    """Stop a strict reconstruction.

    Raises
    ------
    DoubtfulScanError
        If there is a warning: the texts of all, and their names.
    """
    found = list(found)
    if found:
        texts, names = "; ".join(each.text for each in found), ", ".join(each.name for each in found)
        raise DoubtfulScanError(f"{texts} ({names}). Without --strict (strict=False) this is a warning only")


def file_warnings(path: Path, facts: FileFacts) -> list[QualityWarning]:
    """What the file of a scan contradicts itself in."""
    return [QualityWarning("file", f"{printable_name(path.name)}: {fault}") for fault in facts.faults]


def value_warnings(scan: Volume) -> list[QualityWarning]:
    """Whether a scan has as few values as a mask."""
    n_values = len(np.unique(scan.data[::2, ::2, ::2]))
    if n_values >= FEWEST_VALUES:
        return []
    text = f"the scan holds {n_values} different values; a T1 holds hundreds: is it a mask or an image of labels?"
    return [QualityWarning("few_values", text, n_values)]


def mirror_warnings(scan: StandardScan) -> list[QualityWarning]:
    """Whether the registration mirrors a scan."""
    if np.linalg.det(scan.to_standard[:3, :3]) > 0:
        return []
    return [QualityWarning("mirrored", "the registration mirrors the scan: left and right may be exchanged")]


# Rules for scans that are placed by their grey values.


def volume_warnings(scan: Volume) -> list[QualityWarning]:
    """Whether a scan, before it is registered, holds an image of about the volume of an adult's brain."""
    found = value_warnings(scan)
    volume = bright_volume(scan) / 1000
    if not BRIGHT_CM3[0] < volume < BRIGHT_CM3[1]:
        text = (
            f"the bright part of the scan has {volume:.0f} cm³; for the brain of an adult {BRIGHT_CM3[0]:.0f} to "
            f"{BRIGHT_CM3[1]:.0f} are plausible: is it a whole brain, without its skull, and are the voxel sizes right?"
        )
        found.append(QualityWarning("bright_volume", text, volume))
    return found


def scan_warnings(scan: StandardScan, template: Volume) -> list[QualityWarning]:
    """Whether the registered scan looks like the template and has about its size."""
    found = []
    agreement = agreement_with(scan.volume, template)
    if agreement < LOWEST_AGREEMENT:
        text = (
            f"the registered scan and the template agree poorly (correlation {agreement:.2f}, {LOWEST_AGREEMENT} or "
            "more is usual): look whether the brain stands upright in the slices, is a T1, and without its skull"
        )
        found.append(QualityWarning("agreement", text, agreement))
    contrast = contrast_with(scan.volume, template)
    if contrast < LOWEST_CONTRAST:
        text = (
            f"inside the brain the scan differs from a T1 (correlation {contrast:.2f} with the template, "
            f"{LOWEST_CONTRAST} or more is usual): is it a T1, upright, and without its skull?"
        )
        found.append(QualityWarning("contrast", text, contrast))
    gap = gap_in(scan.volume, template) / 1000
    if gap > LARGEST_GAP_CM3:
        text = (
            f"{gap:.0f} cm³ of the template's brain lie in one piece where the scan is empty; {LARGEST_GAP_CM3:.0f} or "
            "less are usual: does the field of view end inside the brain, or was a part cut away with the skull?"
        )
        found.append(QualityWarning("gap", text, gap))
    scales = np.linalg.svd(scan.to_standard[:3, :3], compute_uv=False)
    stretch = float(scales.max() / scales.min())
    if stretch > LARGEST_STRETCH:
        text = (
            f"the registration stretches one direction by {stretch:.2f} against another; "
            f"{LARGEST_STRETCH} or less is usual: is a part of the brain missing?"
        )
        found.append(QualityWarning("stretch", text, stretch))
    scale = float(abs(np.linalg.det(scan.to_standard[:3, :3])) ** (1 / 3))
    if not SCALES[0] < scale < SCALES[1]:
        text = (
            f"the registration scales the scan by {scale:.2f}; {SCALES[0]} to {SCALES[1]} is usual: are the voxel "
            "sizes in its header right?"
        )
        found.append(QualityWarning("scale", text, scale))
    return found + mirror_warnings(scan)


def average_warnings(scan: StandardScan, template: Volume) -> list[QualityWarning]:
    """Whether a scan is so like the template, an average of 152 heads, that it must be an average too."""
    contrast = contrast_with(scan.volume, template)
    if contrast < HIGHEST_CONTRAST:
        return []
    text = (
        f"the scan is like the average of 152 heads (correlation {contrast:.2f} with the template; less than "
        f"{HIGHEST_CONTRAST} is usual): is it a group average? Then its surfaces are those of no person"
    )
    return [QualityWarning("group_average", text, contrast)]


def agreement_with(image: Volume, template: Volume) -> float:
    """The correlation of an image with a template over the grid of the image, in [−1, 1]."""
    return _correlation(image.data, _on_grid(image, template))


def contrast_with(image: Volume, template: Volume) -> float:
    """The correlation of an image with a template inside the brain of the template, in [−1, 1]; 0 if one is constant.

    The outline of the head does not count, in contrast to :func:`agreement_with`.
    """
    there = _on_grid(image, template)
    brain = _inner_brain(there)
    return _correlation(image.data[brain], there[brain])


def gap_in(image: Volume, template: Volume) -> float:
    """The volume of the largest connected part of the template's brain in which an image is empty, in mm³."""
    brain = _inner_brain(_on_grid(image, template))
    if not brain.any():
        return 0.0
    low = float(image.data.min())
    parts, n_parts = label(brain & (image.data - low <= EMPTY_SHARE * (np.percentile(image.data[brain], 90) - low)))
    return float(np.bincount(parts.ravel())[1:].max() * np.prod(voxel_sizes(image))) if n_parts else 0.0


def _inner_brain(there: Float[Array, "x y z"]) -> Bool[Array, "x y z"]:
    """Where the brain of the template is, without its rim."""
    return binary_erosion(there > BRAIN_SHARE * there.max(), iterations=RIM_VOXELS)


def _correlation(first: Array, second: Array) -> float:
    if first.size == 0 or first.min() == first.max() or second.min() == second.max():
        return 0.0
    return float(np.corrcoef(first.ravel(), second.ravel())[0, 1])


def _on_grid(image: Volume, template: Volume) -> Float[Array, "x y z"]:
    """The template at the voxels of the image; beyond it, its least value."""
    return resample(template, image.data.shape, image.affine, outside="lowest").data


def surface_warnings(
    side: str, final: Mesh, initial: Mesh, segmented: SegmentedSurface, repaired: RepairedSurface | None
) -> list[QualityWarning]:
    """Whether one hemisphere has a plausible volume and area, lies where the segmentation is, and had to be mended.

    Final and initial surface are in the same space.
    """
    found = []
    volume = float(signed_volume(final)) / 1000
    if not VOLUMES_CM3[0] < volume < VOLUMES_CM3[1]:
        text = (
            f"the {side} surface encloses {volume:.0f} cm³; {VOLUMES_CM3[0]:.0f} to {VOLUMES_CM3[1]:.0f} are plausible"
        )
        found.append(QualityWarning("surface_volume", text, volume))
    n_lost, loss = voxels_given_up(segmented)
    if loss > LARGEST_LOSS:
        text = (
            f"{n_lost} voxels ({100 * loss:.1f} %) of the {side} white matter were given up to make it a ball without "
            f"handles; {100 * LARGEST_LOSS:.0f} % or less is usual"
        )
        found.append(QualityWarning("voxels_given_up", text, loss))
    area, start = (float(face_areas(mesh).sum()) / 100 for mesh in (final, initial))
    if not AREAS[0] < area / start < AREAS[1]:
        text = (
            f"the {side} surface has {area:.0f} cm², {area / start:.2f} of the area of the segmentation's surface; "
            f"{AREAS[0]} to {AREAS[1]} are plausible: were sulci left out, or is it folded onto itself?"
        )
        found.append(QualityWarning("surface_area", text, area))
    # From either surface to the other: a surface that leaves sulci out is near the other one, but not the reverse.
    apart = max(float(vertex_distances(one, other).mean()) for one, other in ((final, initial), (initial, final)))
    if apart > LARGEST_DISTANCE_MM:
        text = (
            f"the {side} surface lies {apart:.1f} mm from that of the segmentation on average; "
            f"{LARGEST_DISTANCE_MM} or less is usual: look at it in the slices"
        )
        found.append(QualityWarning("segmentation_distance", text, apart))
    if repaired is None:
        return found + crossing_warnings(side, final)
    # A few faces cross after nearly every flow; that alone is in the numbers, not among the warnings.
    many = repaired.n_crossing > LARGEST_CROSSING * len(repaired.mesh.faces)
    if many or repaired.n_backtracks > 0 or repaired.largest_move > LARGEST_REPAIR_MM:
        share = 100 * repaired.n_crossing / len(final.faces)
        text = (
            f"{repaired.n_crossing} faces ({share:.2g} %) of the {side} surface crossed after the flow; the repair "
            f"moved vertices by up to {repaired.largest_move:.2g} mm"
        )
        if repaired.n_backtracks:
            text += f", with {repaired.n_backtracks} backtracks towards the initial surface"
        found.append(QualityWarning("crossing_faces", text, share))
    return found


def crossing_warnings(side: str, mesh: Mesh) -> list[QualityWarning]:
    """Whether many faces of a surface that no repair follows cross others."""
    n_crossing = len(self_intersecting_faces(mesh))
    share = 100 * n_crossing / len(mesh.faces)
    if share <= 100 * LARGEST_LEFT_CROSSING:
        return []
    text = (
        f"{n_crossing} faces ({share:.2g} %) of the {side} surface cross others; "
        f"{100 * LARGEST_LEFT_CROSSING:g} % or less is usual: volume and thickness need a surface without them"
    )
    return [QualityWarning("crossing_faces", text, share)]


# Rules for scans that are placed by their white matter.


@dataclasses.dataclass(frozen=True)
class Limit:
    """The usual range of one of the :func:`quality_numbers`, and what is said beyond it."""

    number: str
    warning: WarningName
    low: float
    high: float
    text: str  # with {value}, and {low} or {high}


_INF = float("inf")
#: The limits are the extremes of 24 good heads, moved by their range: ``experiments/warnings/second``, which has the
#: shares of good and of spoiled heads that get a warning.
LIMITS = (
    Limit("voxel_mm", "voxel_size", 0.0, 2.22, "the largest side of a voxel has {value:.2g} mm; {high:.2g} or less is "
          "what the networks were tried with: thin folds may be lost"),
    Limit("contrast", "contrast", 0.172, _INF, "inside the brain the scan differs from a T1 (correlation {value:.2f} "
          "with the template, {low:.2f} or more is usual): is it a T1, and upright?"),
    Limit("gap_cm3", "gap", 0.0, 0.136, "{value:.2g} cm³ of the template's brain lie in one piece where the scan is "
          "empty; {high:.2g} or less are usual: does the field of view end inside the brain, or was a part cut away?"),
    Limit("stretch", "stretch", 1.0, 1.41, "the placement stretches one direction by {value:.2f} against another; "
          "{high:.2f} or less is usual: is a part of the brain missing?"),
    Limit("scale", "scale", 0.887, 1.27, "the placement scales the scan by {value:.2f}; {low:.2f} to {high:.2f} is "
          "usual: are the voxel sizes in its header right, and is it an adult?"),
    Limit("least_volume_cm3", "surface_volume", 111.0, _INF, "the surface of one side encloses {value:.0f} cm³; "
          "{low:.0f} or more are usual: is a part of the brain missing?"),
    Limit("largest_volume_cm3", "surface_volume", 0.0, 417.0, "the surface of one side encloses {value:.0f} cm³; "
          "{high:.0f} or less are usual: does it leave the brain?"),
    Limit("side_ratio", "sides", 1.0, 1.27, "one side encloses {value:.2f} times the volume of the other; {high:.2f} "
          "or less is usual: is a part of one side missing?"),
    Limit("largest_area_over_initial", "surface_area", 0.0, 1.36, "one surface has {value:.2f} of the area of the "
          "segmentation's surface; {high:.2f} or less is usual: is it folded onto itself?"),
    Limit("given_up", "voxels_given_up", 0.0, 0.0413, "of one side {value:.1%} of the white matter were given up to "
          "make it a ball without handles; {high:.1%} or less is usual: look for cuts in the slices"),
    Limit("from_segmentation_mm", "segmentation_distance", 0.0, 0.720, "one surface lies {value:.2f} mm from that of "
          "the segmentation on average; {high:.2f} or less is usual: look at it in the slices"),
    Limit("brighter_inside", "border", 0.902, 1.0, "at {value:.0%} of one surface the scan is brighter inside than "
          "outside; {low:.0%} or more is usual: is the scan a T1 with little noise, and does the surface follow it?"),
)  # fmt: skip


def number_warnings(numbers: Mapping[str, float]) -> list[QualityWarning]:
    """Which numbers of a reconstruction lie beyond :data:`LIMITS`. What is no number lies beyond every limit."""
    return [
        QualityWarning(each.warning, each.text.format(value=value, low=each.low, high=each.high), value)
        for each in LIMITS
        if not each.low <= (value := numbers[each.number]) <= each.high
    ]


# Numbers of a finished reconstruction that may show a failure.

#: How far from the surface, inside and outside, the scan is read, in mm.
_STEP_MM = 0.75


def quality_numbers(
    scan: Volume, placed: StandardScan, template: Volume, surfaces: Mapping[str, "HemisphereSurface"]
) -> dict[str, float]:
    """Numbers that tell good reconstructions from bad ones without the truth, by name.

    Of two sides, the number of the worse one is given.

    Parameters
    ----------
    scan : Volume
    placed : StandardScan
        The scan where the networks saw it.
    template : Volume
        The average, in the space of ``placed``.
    surfaces : mapping
        By side: see :class:`meshot.pipeline.Reconstruction`.
    """
    numbers = {
        "voxel_mm": float(voxel_sizes(scan).max()),
        "contrast": contrast_with(placed.volume, template),
        "gap_cm3": gap_in(placed.volume, template) / 1000,
    }
    scales = np.linalg.svd(placed.to_standard[:3, :3], compute_uv=False)
    numbers |= {"stretch": float(scales.max() / scales.min()), "scale": float(scales.prod() ** (1 / 3))}
    sides: dict[str, list[float]] = {}
    for found in surfaces.values():
        area, start = (float(face_areas(mesh).sum()) for mesh in (found.final, found.initial))
        inside, outside = border_values(scan, found.final)
        steps = inside - outside
        spread = float(steps.std())
        of_side = {
            "volume_cm3": float(signed_volume(found.final)) / 1000,
            "area_over_initial": area / start,
            "given_up": voxels_given_up(found.segmented)[1],
            "from_segmentation_mm": max(
                float(vertex_distances(*pair).mean())
                for pair in ((found.final, found.initial), (found.initial, found.final))
            ),
            "brighter_inside": float((steps > 0).mean()),
            "step": float(steps.mean()) / spread if spread else 0.0,
            "crossed": 0.0 if found.repaired is None else found.repaired.n_crossing / len(found.final.faces),
        }
        for name, value in of_side.items():
            sides.setdefault(name, []).append(value)
    volumes, areas = sides.pop("volume_cm3"), sides.pop("area_over_initial")
    numbers |= {"least_volume_cm3": min(volumes), "largest_volume_cm3": max(volumes)}
    numbers |= {"side_ratio": max(volumes) / max(min(volumes), 1e-9)}
    numbers |= {"least_area_over_initial": min(areas), "largest_area_over_initial": max(areas)}
    return numbers | {name: (min if name in ("brighter_inside", "step") else max)(both) for name, both in sides.items()}


def border_values(scan: Volume, mesh: Mesh) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """The scan a little inside and a little outside of each vertex of a white surface, in scanner RAS."""
    points, normals = mesh.vertices.double(), vertex_normals(mesh).double()
    inside, outside = (sample_volume(scan, points + step * normals).numpy() for step in (-_STEP_MM, _STEP_MM))
    return inside, outside


def voxels_given_up(segmented: SegmentedSurface) -> tuple[int, float]:
    """How many voxels of the mask the genus-0 correction gave up, and which part of the mask they are."""
    before, after = (int(mask.data.sum()) for mask in (segmented.mask, segmented.genus_zero_mask))
    return before - after, (before - after) / before
