"""What looks odd about a reconstruction, in a sentence each: signs of failure, not proofs, and not all there are."""

import numpy as np
from scipy.ndimage import affine_transform

from meshot.flow.crossings import RepairedSurface
from meshot.mesh import Mesh
from meshot.mesh.geometry import signed_volume
from meshot.pipeline.segmentation.surface import SegmentedSurface
from meshot.volume import StandardScan, Volume

#: Scans of the synthetic cohorts reach .79 to .84; upside down, back to front or with inverted contrast, .71.
LOWEST_AGREEMENT = 0.75
#: Heads differ from the template by less, in each direction on average.
SCALES = (0.75, 1.33)
#: What the white surface of one adult hemisphere may enclose, ventricles and basal ganglia included, in cm³.
VOLUMES_CM3 = (120.0, 450.0)
#: Clean segmentations lose about one hundredth on the way to genus 0.
LARGEST_LOSS = 0.03
#: Of the faces, after a flow: on held-out heads the shipped kind of flow leaves less than a fifth of a hundredth.
LARGEST_CROSSING = 0.005
#: How far mending may move a vertex, in mm; on these heads it stays at a few.
LONGEST_MENDING_MM = 6.0


def scan_warnings(scan: StandardScan, template: Volume) -> list[str]:
    """Whether the registered scan looks like the template and has about its size.

    Parameters
    ----------
    scan : StandardScan
    template : Volume
    """
    found = []
    agreement = agreement_with(scan.volume, template)
    if agreement < LOWEST_AGREEMENT:
        found.append(
            f"the registered scan and the template agree poorly (correlation {agreement:.2f}, {LOWEST_AGREEMENT} or "
            "more is usual): look whether the brain stands upright in the slices, is a T1, and without its skull"
        )
    determinant = float(np.linalg.det(scan.to_standard[:3, :3]))
    scale = abs(determinant) ** (1 / 3)
    if not SCALES[0] < scale < SCALES[1]:
        found.append(
            f"the registration scales the scan by {scale:.2f}; {SCALES[0]} to {SCALES[1]} is usual: are the voxel "
            "sizes in its header right?"
        )
    if determinant < 0:
        found.append("the registration mirrors the scan: left and right may be exchanged")
    return found


def agreement_with(image: Volume, template: Volume) -> float:
    """The correlation of an image with a template over the grid of the image, in [−1, 1].

    Parameters
    ----------
    image, template : Volume
        In the same space; beyond the template its least value counts.
    """
    to_voxel = np.linalg.inv(template.affine) @ image.affine
    low = float(template.data.min())
    there = affine_transform(
        template.data.astype(np.float32), to_voxel[:3, :3], to_voxel[:3, 3], image.data.shape, order=1, cval=low
    )
    return float(np.corrcoef(image.data.ravel(), there.ravel())[0, 1])


def surface_warnings(side: str, final: Mesh, segmented: SegmentedSurface, settled: RepairedSurface | None) -> list[str]:
    """Whether one hemisphere has a plausible volume, and how much of it had to be mended.

    Parameters
    ----------
    side : str
    final : Mesh
        In mm of the scanner.
    segmented : SegmentedSurface
    settled : RepairedSurface or None
    """
    found = []
    volume = float(signed_volume(final)) / 1000
    if not VOLUMES_CM3[0] < volume < VOLUMES_CM3[1]:
        found.append(
            f"the {side} surface encloses {volume:.0f} cm³; {VOLUMES_CM3[0]:.0f} to {VOLUMES_CM3[1]:.0f} are plausible"
        )
    n_lost, loss = voxels_given_up(segmented)
    if loss > LARGEST_LOSS:
        found.append(
            f"{n_lost} voxels ({100 * loss:.1f} %) of the {side} white matter were given up to make it a ball without "
            f"handles; {100 * LARGEST_LOSS:.0f} % or less is usual"
        )
    if settled is not None and _much_was_settled(settled):
        share = 100 * settled.n_crossing / len(final.faces)
        found.append(
            f"{settled.n_crossing} faces ({share:.2g} %) of the {side} surface crossed after the flow; mending moved "
            f"vertices by up to {settled.largest_move:.2g} mm" + _retreats(settled)
        )
    return found


def _much_was_settled(settled: RepairedSurface) -> bool:
    """A few faces cross after nearly every flow; that alone is in the numbers, not among the warnings."""
    many = settled.n_crossing > LARGEST_CROSSING * len(settled.mesh.faces)
    return many or settled.n_backtracks > 0 or settled.largest_move > LONGEST_MENDING_MM


def _retreats(settled: RepairedSurface) -> str:
    return f", with {settled.n_backtracks} retreats towards the initial surface" if settled.n_backtracks else ""


def voxels_given_up(segmented: SegmentedSurface) -> tuple[int, float]:
    """How many voxels of the mask the genus-0 correction gave up, and which part of the mask they are."""
    before, after = (int(mask.data.sum()) for mask in (segmented.mask, segmented.genus_zero_mask))
    return before - after, (before - after) / before
