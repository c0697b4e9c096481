"""From one scan to the white surfaces of both hemispheres, in the scanner's space."""

import dataclasses
from collections.abc import Mapping

from meshot.anatomy import HEMISPHERES, Hemisphere, mni152_t1
from meshot.errors import require_positive_integer
from meshot.flow.crossings import RepairedSurface, repair_crossings
from meshot.mesh import Mesh
from meshot.model import N_STEPS, DeformationNetwork, SegmentationNetwork
from meshot.pipeline.deformation.carrying import deformed
from meshot.pipeline.quality_warnings import scan_warnings, surface_warnings
from meshot.pipeline.segmentation.segmenting import in_scanner, white_matter
from meshot.pipeline.segmentation.surface import SegmentedSurface, segmented_surface
from meshot.pipeline.stages import Progress, StageClock
from meshot.volume import StandardScan, Volume, standard_scan


@dataclasses.dataclass(frozen=True, eq=False)
class HemisphereSurface:
    """The white surface of one hemisphere.

    Parameters
    ----------
    initial, final : Mesh
        Before and after the flow, with the same faces; in scanner RAS of the scan, in mm, outward, χ = 2, no
        self-intersecting face.
    segmented : SegmentedSurface
        The stages of the initial surface, in the standard space.
    settled : RepairedSurface or None
        What the flow left with crossing faces, and how that was mended, in the standard space; None without a flow.
    """

    initial: Mesh
    final: Mesh
    segmented: SegmentedSurface
    settled: RepairedSurface | None


@dataclasses.dataclass(frozen=True, eq=False)
class Reconstruction:
    """What a scan became, how long it took, and what there is to doubt.

    Parameters
    ----------
    scan : StandardScan
        The scan on the standard grid, and the way back.
    surfaces : dict
        By side.
    cpu_seconds, wall_seconds : dict
        By stage: processor time of all threads, and by the clock.
    warnings : tuple of str
        Empty if nothing looks odd, which does not mean that all is well.
    n_steps : int
        Of the flow; 0 without one.
    """

    scan: StandardScan
    surfaces: dict[Hemisphere, HemisphereSurface]
    cpu_seconds: dict[str, float]
    wall_seconds: dict[str, float]
    warnings: tuple[str, ...]
    n_steps: int


def reconstruct(
    scan: Volume,
    segmentation: SegmentationNetwork,
    deformation: Mapping[Hemisphere, DeformationNetwork] | None,
    n_steps: int = N_STEPS,
    progress: Progress | None = None,
    template: Volume | None = None,
    method: str = "euler",
) -> Reconstruction:
    """The white surfaces of both hemispheres in a scan.

    Registration to the MNI152 average → white matter of both sides → initial surfaces → flow → faces that cross apart
    → back to the scanner. Without crossing faces, whatever the networks do: see
    :func:`meshot.flow.crossings.repair_crossings`.

    Parameters
    ----------
    scan : Volume
        A T1 in scanner RAS, in any orientation and voxel size.
    segmentation : SegmentationNetwork
    deformation : mapping or None
        A network for each side; None: the initial surfaces are the result.
    n_steps : int
        Of the flow.
    progress : callable, optional
        Is told which stage begins, how many are done, and how many there are; at the end once more, without a name.
    template : Volume, optional
        Where to register to; the MNI152 average if left out, which the shipped networks know.
    method : str
        Of integration: see :func:`meshot.integrate`. Networks know what they were trained with, both ways.

    Raises
    ------
    ValueError
        If the scan is constant, cannot be registered, or shows the network no white matter; if a side has no network;
        ``n_steps`` is not a positive integer, or the method is unknown.
    """
    require_positive_integer(n_steps, "n_steps")
    if deformation is not None and set(deformation) != set(HEMISPHERES):
        raise ValueError(f"deformation has networks for {sorted(deformation)}; one for each of {HEMISPHERES} is needed")
    template = mni152_t1() if template is None else template
    clock = StageClock(4 if deformation is None else 6, progress)
    with clock.stage("registration"):
        standard = standard_scan(scan, template)
    with clock.stage("white matter"):
        probability = white_matter(standard, segmentation)
    segmented, settlement = {}, {}
    for side in HEMISPHERES:
        with clock.stage(f"initial surface, {side}"):
            segmented[side] = segmented_surface(probability[side])
    for side in HEMISPHERES if deformation is not None else ():
        with clock.stage(f"flow, {side}"):
            initial = segmented[side].mesh
            settlement[side] = repair_crossings(
                initial, deformed(initial, standard.volume, deformation[side], n_steps, method)
            )
    clock.end()
    surfaces = {side: _in_scanner(segmented[side], settlement.get(side), standard) for side in HEMISPHERES}
    found = scan_warnings(standard, template)
    for side, surface in surfaces.items():
        found += surface_warnings(side, surface.final, surface.segmented, surface.settled)
    steps = 0 if deformation is None else n_steps
    return Reconstruction(standard, surfaces, clock.cpu_seconds, clock.wall_seconds, tuple(found), steps)


def _in_scanner(segmented: SegmentedSurface, found: RepairedSurface | None, scan: StandardScan) -> HemisphereSurface:
    initial = in_scanner(segmented.mesh, scan)
    final = initial if found is None else in_scanner(found.mesh, scan)
    return HemisphereSurface(initial, final, segmented, found)
