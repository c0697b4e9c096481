"""From one scan to the white surfaces, and perhaps pial ones, of both hemispheres, in the scanner's space."""

import dataclasses
from collections.abc import Mapping

from meshot.anatomy import HEMISPHERES, Hemisphere, mni152_t1
from meshot.flow.crossings import RepairedSurface, repair_crossings
from meshot.mesh import Mesh
from meshot.model import SegmentationNetwork
from meshot.pipeline.correspondence import CarriedTemplate
from meshot.pipeline.placing import carried_in_place, placed_white_matter
from meshot.pipeline.quality_warnings import require_no_warnings, scan_warnings, surface_warnings, volume_warnings
from meshot.pipeline.segmentation.segmenting import in_scanner
from meshot.pipeline.segmentation.surface import SegmentedSurface, segmented_surface
from meshot.pipeline.stages import Progress, StageClock
from meshot.systems import Scan, SurfaceKey, SurfaceSystem
from meshot.volume import StandardScan, Volume, standard_scan

_WHITE = tuple((side, "white") for side in HEMISPHERES)
# The package's flows leave more than 1 % of the faces crossing in most heads, and less than 3 %. Smoothing is enough
# for these. With the defaults most surfaces would be moved back, and their ASSD would be larger.
_REPAIR = {"max_rounds": 40, "largest_share": 0.03}


@dataclasses.dataclass(frozen=True, eq=False)
class HemisphereSurface:
    """The white surface of one hemisphere, and the pial one if the system finds it.

    Parameters
    ----------
    initial, final : Mesh
        The initial white surface and the result of the system, in scanner RAS of the scan, in mm, with outward
        normals. If the system deforms the initial surface, both have the same faces, Euler number 2, and no crossing
        faces.
    segmented : SegmentedSurface
        The stages of the initial surface, in the standard space.
    repaired : RepairedSurface or None
        The surface after the repair of crossing faces, with a record of the repair, in the standard space. None if the
        system does not deform an initial surface.
    carried : CarriedTemplate or None
        The surface of the template in the place of ``final``, if it was asked for.
    pial : Mesh or None
        In the space of ``final``, as the system gives it: faces that cross are not repaired. None if the system finds
        white surfaces only.
    """

    initial: Mesh
    final: Mesh
    segmented: SegmentedSurface
    repaired: RepairedSurface | None
    carried: CarriedTemplate | None = None
    pial: Mesh | None = None

    def meshes(self) -> dict[str, Mesh]:
        """All surfaces by name: "white", "initial", and of "fsaverage5" (the template) and "pial" what is there."""
        carried = None if self.carried is None else self.carried.mesh
        found = {"white": self.final, "initial": self.initial, "fsaverage5": carried, "pial": self.pial}
        return {name: mesh for name, mesh in found.items() if mesh is not None}


@dataclasses.dataclass(frozen=True, eq=False)
class Reconstruction:
    """The surfaces of a scan, the time of each stage, and the warnings.

    Parameters
    ----------
    scan : StandardScan
        The scan on the standard grid, with its transforms.
    surfaces : dict
        By side.
    cpu_seconds, wall_seconds : dict
        Processor time of all threads and wall-clock time, by stage.
    warnings : tuple of str
        Signs of failure. An empty tuple does not prove success.
    system : str or None
        The name of the system; None if the initial surfaces are the result.
    registered : StandardScan
        The scan in MNI152 space, by the registration of grey values. ``scan`` may be placed otherwise, see
        :func:`meshot.anatomy.placed_by_white_matter`.
    """

    scan: StandardScan
    surfaces: dict[Hemisphere, HemisphereSurface]
    cpu_seconds: dict[str, float]
    wall_seconds: dict[str, float]
    warnings: tuple[str, ...]
    system: str | None
    registered: StandardScan


def reconstruct(
    scan: Volume,
    segmentation: SegmentationNetwork,
    system: SurfaceSystem | None,
    progress: Progress | None = None,
    template: Volume | None = None,
    strict: bool = False,
    correspondence: bool = False,
) -> Reconstruction:
    """The white surfaces of both hemispheres in a scan, and the pial ones if the system finds them.

    The stages are: registration to the MNI152 average, segmentation of white matter, initial surfaces, the system,
    repair of crossing faces, and the transform back to the scanner. If the system deforms the initial surfaces, the
    result has no crossing faces: see :func:`meshot.flow.crossings.repair_crossings`. A system may ask for
    scans that are placed by their white matter: then it is found twice, before and after
    :func:`meshot.anatomy.placed_by_white_matter`.

    Parameters
    ----------
    scan : Volume
        A T1 in scanner RAS, in any orientation and voxel size.
    segmentation : SegmentationNetwork
    system : SurfaceSystem or None
        Trained; None: the initial surfaces are the result.
    progress : callable, optional
        Called with the name of the stage that begins, the number of finished stages, and the number of stages. At the
        end it is called once more with an empty name.
    template : Volume, optional
        Where to register to; the MNI152 average if left out, which the shipped networks know.
    strict : bool
        Whether a warning is an error: of the scan before it is segmented, of the surfaces at the end.
    correspondence : bool
        Whether to carry fsaverage5's white surface to each result, so that vertices correspond between people: see
        :func:`meshot.pipeline.correspondence.carry_template`. Some fifty seconds of one core for each side.

    Raises
    ------
    ValueError
        If the scan is constant, cannot be registered, or shows the network no white matter; or if the system does not
        find the white surfaces of both sides; or if something looks odd, and ``strict`` is set.
    """
    if system is not None and not set(_WHITE) <= set(system.surfaces):
        raise ValueError(f"{system.name} finds {system.surfaces}; both white surfaces are needed here")
    template = mni152_t1() if template is None else template
    placement = segmentation.placement if system is None else system.placement
    clock = StageClock((4 if system is None else 6) + len(HEMISPHERES) * correspondence, progress)
    with clock.stage("registration"):
        registered = standard_scan(scan, template, quick=True)
        warnings = volume_warnings(scan) + scan_warnings(registered, template)
    if strict:
        require_no_warnings(warnings)
    with clock.stage("white matter"):
        standard, probability, doubts = placed_white_matter(scan, registered, segmentation, placement)
    warnings += doubts
    segmented, found, settlement = {}, {}, {}
    for side in HEMISPHERES:
        with clock.stage(f"initial surface, {side}"):
            segmented[side] = segmented_surface(probability[side])
    if system is not None:
        with clock.stage(f"system {system.name}"):
            initial = {key: segmented[key[0]].mesh for key in system.needs}
            found = system.reconstruct(Scan(standard.volume, initial))
        with clock.stage("crossing faces"):
            settlement = {key: repair_crossings(mesh, found[key], **_REPAIR) for key, mesh in initial.items()}
    final = found | {key: repaired.mesh for key, repaired in settlement.items()}
    carried = {}
    for key in _WHITE if correspondence else ():
        with clock.stage(f"template, {key[0]}"):
            mesh = final.get(key, segmented[key[0]].mesh)
            carried[key] = carried_in_place(mesh, key[0], placement)
    clock.end()
    surfaces = {side: _surface(side, segmented[side], final, settlement, carried, standard) for side in HEMISPHERES}
    name = None if system is None else system.name
    for side, surface in surfaces.items():
        warnings += surface_warnings(side, surface.final, surface.segmented, surface.repaired)
    if strict:
        require_no_warnings(warnings)
    seconds = clock.cpu_seconds, clock.wall_seconds
    return Reconstruction(standard, surfaces, *seconds, tuple(warnings), name, registered)


def _surface(
    side: Hemisphere,
    segmented: SegmentedSurface,
    final: Mapping[SurfaceKey, Mesh],
    repaired: Mapping[SurfaceKey, RepairedSurface],
    carried: Mapping[SurfaceKey, CarriedTemplate],
    scan: StandardScan,
) -> HemisphereSurface:
    key, initial = (side, "white"), in_scanner(segmented.mesh, scan)
    white, pial = (None if kind not in final else in_scanner(final[kind], scan) for kind in (key, (side, "pial")))
    template = carried.get(key)
    if template is not None:
        template = dataclasses.replace(template, mesh=in_scanner(template.mesh, scan))
    white = initial if white is None else white
    return HemisphereSurface(initial, white, segmented, repaired.get(key), template, pial)
