"""From one scan to the white surfaces, and perhaps pial ones, of both hemispheres, in the scanner's space."""

import contextlib
import dataclasses
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from meshot.anatomy import HEMISPHERES, Hemisphere, enlarged, from_mni152, in_mni152, mni152_t1, placed_by_white_matter
from meshot.flow import RepairedSurface, nest_surfaces, repair_crossings
from meshot.mesh import Mesh, united
from meshot.metrics import corresponds
from meshot.model import SegmentationNetwork, network_digest, read_weights
from meshot.pipeline.correspondence import CarriedTemplate, carry_template
from meshot.pipeline.initial_surface import SegmentedSurface, segmented_surface
from meshot.pipeline.mirror import find_both_ways, segment_both_ways
from meshot.pipeline.quality import (
    QualityWarning,
    crossing_warnings,
    mirror_warnings,
    number_warnings,
    quality_numbers,
    require_no_warnings,
    scan_warnings,
    surface_warnings,
    value_warnings,
    volume_warnings,
)
from meshot.pipeline.segmentation import in_scanner, require_white_matter, segment
from meshot.systems import SHIPPED, Scan, SurfaceSystem, load_system
from meshot.types import PLACEMENTS, Placement
from meshot.volume import StandardScan, Volume, largest_component, standard_scan, with_dark_background

# Timing and progress reports of computations that consist of stages.

#: Called with the name of the stage that begins, the number of finished stages, and the number of stages.
Progress = Callable[[str, int, int], None]


class StageClock:
    """A timer for stages, which also reports progress."""

    # ``progress``: called at the start of each stage.

    def __init__(self, n_stages: int, progress: Progress | None = None):
        self.n_stages, self.progress = n_stages, progress
        self.cpu_seconds: dict[str, float] = {}
        self.wall_seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the block's processor time (of all threads) and wall-clock time, in seconds."""
        self._tell(name)
        cpu, wall = time.process_time(), time.perf_counter()
        yield
        self.cpu_seconds[name] = time.process_time() - cpu
        self.wall_seconds[name] = time.perf_counter() - wall

    def end(self) -> None:
        """Report that the last stage is finished."""
        self._tell("")

    def _tell(self, name: str) -> None:
        if self.progress is not None:
            self.progress(name, len(self.cpu_seconds), self.n_stages)


_WHITE, _PIAL = (tuple((side, kind) for side in HEMISPHERES) for kind in ("white", "pial"))
# The package's flows leave more than 1 % of the faces crossing in most heads, and less than 3 %. Smoothing is enough
# for these. With the defaults most surfaces would be moved back, and their ASSD would be larger.
_REPAIR = {"max_rounds": 40, "largest_share": 0.03}


@dataclasses.dataclass(frozen=True, eq=False)
class HemisphereSurface:
    """The white surface of one hemisphere, and the pial one if the system finds it."""

    # initial, final: the initial white surface and the result of the system, in scanner RAS of the scan, in mm, with
    # outward normals. If the system deforms the initial surface, both have the same faces, Euler number 2, and no
    # crossing faces.
    initial: Mesh
    final: Mesh
    segmented: SegmentedSurface  # the stages of the initial surface, in the standard space
    # the surface after the repair of crossing faces, with a record of the repair, in the standard space. None if the
    # system does not deform an initial surface.
    repaired: RepairedSurface | None
    carried: CarriedTemplate | None = None  # the surface of the template in the place of ``final``, if it was asked for
    # in the space of ``final``. If it has the faces of ``final``, faces that cross are repaired, within it and between
    # the four surfaces. None if the system finds white surfaces only.
    pial: Mesh | None = None
    # what the system found, before the repair, in the space of ``final``; None if nothing is repaired.
    unrepaired: Mesh | None = None

    def meshes(self) -> dict[str, Mesh]:
        """All surfaces by name: "white", "initial", and what is there of "fsaverage5" (the template), "pial", and
        "midthickness", which lies half-way between white and pial surface.
        """
        carried, middle = None if self.carried is None else self.carried.mesh, None
        if corresponds(self.final, self.pial):
            middle = self.final.with_vertices((self.final.vertices + self.pial.vertices) / 2)
        found = {"white": self.final, "initial": self.initial, "fsaverage5": carried, "pial": self.pial}
        found["midthickness"] = middle
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
    warnings : tuple of QualityWarning
        Signs of failure. An empty tuple does not prove success.
    system : str or None
        The name of the system; None if the initial surfaces are the result.
    registered : StandardScan
        The scan in MNI152 space, by the registration of grey values. ``scan`` may be placed otherwise, see
        :func:`meshot.anatomy.placed_by_white_matter`.
    placement : str
        How ``scan`` is placed. By white matter, it is in the enlarged standard space.
    """

    scan: StandardScan
    surfaces: dict[Hemisphere, HemisphereSurface]
    cpu_seconds: dict[str, float]
    wall_seconds: dict[str, float]
    warnings: tuple[QualityWarning, ...]
    system: str | None
    registered: StandardScan
    placement: Placement = PLACEMENTS[0]


def reconstruct(
    scan: Volume,
    segmentation: SegmentationNetwork,
    system: SurfaceSystem | None,
    progress: Progress | None = None,
    template: Volume | None = None,
    strict: bool = False,
    correspondence: bool = False,
    both_ways: bool | None = None,
) -> Reconstruction:
    """The white surfaces of both hemispheres in a scan, and the pial ones if the system finds them.

    The stages are: registration to the MNI152 average, segmentation of white matter, initial surfaces, the system,
    repair of crossing faces, and the transform back to the scanner. If the system deforms the initial surfaces, the
    result has no crossing faces: see :func:`meshot.flow.repair_crossings`. A system may ask for
    scans that are placed by their white matter: then it is found twice, before and after
    :func:`meshot.anatomy.placed_by_white_matter`. If it carries white surfaces to pial ones, a last stage keeps all
    four apart: see :func:`meshot.flow.nest_surfaces`.

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
        Whether a warning is an error: of the scan before it is segmented, and of the finished reconstruction. What is
        wrong with a scan that is placed by its white matter is mostly known at the end.
    correspondence : bool
        Whether to carry fsaverage5's white surface to each result, so that vertices correspond between people: see
        :func:`meshot.pipeline.carry_template`. Some fifty seconds of one core for each side.
    both_ways : bool, optional
        Whether white matter and surfaces are found in the scan and in its mirror image, and averaged. By default they
        are, if scans are placed by their white matter, as for the networks of the package. Otherwise a reconstruction
        takes some five seconds less, and a mirrored scan moves its white surfaces by 0.1 mm. The segmentation network
        must have learned from mirrored scans, too. Surfaces of systems that need no initial surface are not averaged.

    Raises
    ------
    ValueError
        If the scan is constant, cannot be registered, or shows the network no white matter; or if the system does not
        find the white surfaces of both sides; or if something looks odd, and ``strict`` is set.
    """
    if system is not None and not set(_WHITE) <= set(system.surfaces):
        raise ValueError(f"{system.name} finds {system.surfaces}; both white surfaces are needed here")
    template = mni152_t1() if template is None else template
    given, scan = scan, with_dark_background(scan)
    placement = segmentation.placement if system is None else system.placement
    both_ways = placement != PLACEMENTS[0] if both_ways is None else both_ways
    n_stages = 4 if system is None else 6 + (bool(system.needs) and set(_PIAL) <= set(system.surfaces))
    clock = StageClock(n_stages + len(HEMISPHERES) * correspondence, progress)
    with clock.stage("registration"):
        registered = standard_scan(scan, template, quick=True)
        if placement == PLACEMENTS[0]:
            warnings = volume_warnings(scan) + scan_warnings(registered, template)
        else:
            warnings = value_warnings(scan) + mirror_warnings(registered)
    if strict:
        require_no_warnings(warnings)
    with clock.stage("white matter"):
        standard, probability, doubts = placed_white_matter(scan, registered, segmentation, placement, both_ways)
    warnings += doubts
    segmented, found, settlement = {}, {}, {}
    for side in HEMISPHERES:
        with clock.stage(f"initial surface, {side}"):
            segmented[side] = segmented_surface(probability[side])
    if system is not None:
        with clock.stage(f"system {system.name}"):
            initial = {key: segmented[key[0]].mesh for key in system.needs}
            seen = Scan(standard.volume, initial)
            found = find_both_ways(system, seen) if both_ways and initial else system.reconstruct(seen)
        with clock.stage("crossing faces"):
            settlement = {key: repair_crossings(mesh, found[key], **_REPAIR) for key, mesh in initial.items()}
    final = found | {key: repaired.mesh for key, repaired in settlement.items()}
    if all(
        side_white in settlement and corresponds(final[side_white], found.get(side_pial))
        for side_white, side_pial in zip(_WHITE, _PIAL, strict=True)
    ):
        with clock.stage("four surfaces"):
            try:
                whites, pials = (united([final[key] for key in keys]) for keys in (_WHITE, _PIAL))
                whites, pials = nest_surfaces(whites, pials)
            except ValueError as error:
                text = f"faces of two of the four surfaces cross ({error}): look at them in the slices"
                warnings.append(QualityWarning("crossing_faces", text))
            else:
                for keys, whole in ((_WHITE, whites), (_PIAL, pials)):
                    parts = whole.vertices.split([len(final[key].vertices) for key in keys])
                    final |= {key: final[key].with_vertices(part) for key, part in zip(keys, parts, strict=True)}
    carried = {}
    for key in _WHITE if correspondence else ():
        with clock.stage(f"template, {key[0]}"):
            mesh = final.get(key, segmented[key[0]].mesh)
            carried[key] = carried_in_place(mesh, key[0], placement)
    clock.end()
    surfaces = {}
    for side in HEMISPHERES:
        key, start = (side, "white"), in_scanner(segmented[side].mesh, standard)
        white, pial = (in_scanner(final[k], standard) if k in final else None for k in (key, (side, "pial")))
        placed = carried.get(key)
        if placed is not None:
            placed = dataclasses.replace(placed, mesh=in_scanner(placed.mesh, standard))
        white = start if white is None else white
        unrepaired = in_scanner(found[key], standard) if key in settlement else None
        surfaces[side] = HemisphereSurface(start, white, segmented[side], settlement.get(key), placed, pial, unrepaired)
    name = None if system is None else system.name
    if placement != PLACEMENTS[0]:
        warnings += number_warnings(quality_numbers(given, standard, enlarged(template), surfaces))
    for side, each in surfaces.items():
        if placement == PLACEMENTS[0]:
            warnings += surface_warnings(side, each.final, each.initial, each.segmented, each.repaired)
        elif each.repaired is None:
            warnings += crossing_warnings(side, each.final)
    if strict:
        require_no_warnings(warnings)
    seconds = clock.cpu_seconds, clock.wall_seconds
    return Reconstruction(standard, surfaces, *seconds, tuple(warnings), name, registered, placement)


# The trained networks of a reconstruction: the segmentation network and a system, with the package's weights.

SEGMENTATION = "segmentation.safetensors"


@dataclasses.dataclass(frozen=True, eq=False)
class TrainedNetworks:
    """The trained networks of a reconstruction.

    Parameters
    ----------
    segmentation : SegmentationNetwork
    system : SurfaceSystem or None
        None if only initial surfaces are needed.
    records : dict
        The record of the training of each network, by file name.
    """

    segmentation: SegmentationNetwork
    system: SurfaceSystem | None
    records: dict[str, dict]


def segmentation_weights(path: str | os.PathLike | None = None) -> Path:
    """The path of the weights of the segmentation network: ``path``, or the file in the package.

    Raises
    ------
    ValueError
        If the file is missing.
    """
    found = SHIPPED / SEGMENTATION if path is None else Path(path)
    if not found.is_file():
        place = "this installation came without them" if path is None else f"{found} does not exist"
        raise ValueError(
            f"the weights of the segmentation network are missing: {place}; name their file (--segmentation), or train "
            "them (meshot train-segmentation)"
        )
    return found


def require_placement(segmentation: SegmentationNetwork, placement: Placement, what: str) -> None:
    """Check that a segmentation network can place scans as they are needed."""
    # A network that learned from scans placed by their white matter knows the other placement, too.
    if placement != PLACEMENTS[0] and segmentation.placement == PLACEMENTS[0]:
        raise ValueError(
            f"{what} needs scans that are placed by {placement}, and the segmentation network learned from scans that "
            f"are placed by {segmentation.placement}: name another one (--segmentation), or leave it out"
        )


def load_networks(
    system: str | None = None,
    weights: str | os.PathLike | None = None,
    segmentation: str | os.PathLike | None = None,
    initial_only: bool = False,
    device: str | None = None,
    white_only: bool = False,
) -> TrainedNetworks:
    """Load the networks of a reconstruction.

    Parameters
    ----------
    system : str, optional
        The name of a system. By default that of the package.
    weights : path, optional
        The folder with the parts of the system. By default that of the package.
    segmentation : path, optional
        The weights of the segmentation network. By default those of the package.
    initial_only : bool
        Whether to load no system.
    device : str, optional
        Where the networks compute, such as "cuda". By default the processor. The other stages of a reconstruction use
        the processor.
    white_only : bool
        Whether to leave the flows of pial surfaces out.

    Raises
    ------
    ValueError
        If a system is unknown, a file is missing or of another kind, the system was trained on initial surfaces of
        another segmentation network, or it finds white and pial surfaces together and ``white_only`` is set.
    """
    network, record = read_weights(segmentation_weights(segmentation), SegmentationNetwork)
    if initial_only:
        return TrainedNetworks(network.to(device), None, {SEGMENTATION: record})
    found = load_system(system, weights)
    found = found.with_white_only() if white_only else found
    records = {f"{name}.safetensors": part.record for name, part in found.parts.items()}
    for name, each in records.items():
        if each.get("results", {}).get("segmentation_sha256", network_digest(network)) != network_digest(network):
            raise ValueError(
                f"{name} was learned from initial surfaces of another network than {SEGMENTATION}: name the one that "
                "it was trained with (--segmentation), or train it anew (meshot train --segmentation)"
            )
    require_placement(network, found.placement, found.name)
    for part in found.parts.values():
        part.network.to(device)
    return TrainedNetworks(network.to(device), found, {SEGMENTATION: record} | records)


# Scans where a system knows them: placed by grey values, or by the white matter that the segmentation finds.


def placed_white_matter(
    scan: Volume, first: StandardScan, network: SegmentationNetwork, placement: Placement, both_ways: bool = False
) -> tuple[StandardScan, dict[Hemisphere, Volume], list[QualityWarning]]:
    """A registered scan in the place that is needed, the probability of white matter there, and warnings."""
    find = segment_both_ways if both_ways else segment
    if placement == PLACEMENTS[0]:
        return first, require_white_matter(find(first.volume, network)), []
    found = require_white_matter(segment(first.volume, network))
    masks = [largest_component(probability.data > 0.5) for probability in found.values()]
    try:
        placed = placed_by_white_matter(scan, first, first.volume.with_data(masks[0] | masks[1]))
    except ValueError as error:
        text = f"the white matter does not place the scan ({error}): is it a T1 of a whole brain?"
        return first, found, [QualityWarning("placement", text)]
    return placed, require_white_matter(find(placed.volume, network)), []


def carried_in_place(mesh: Mesh, side: Hemisphere, placement: Placement) -> CarriedTemplate:
    """:func:`meshot.pipeline.carry_template` for a surface of either standard space."""
    if placement == PLACEMENTS[0]:
        return carry_template(mesh, side)
    carried = carry_template(in_mni152(mesh), side)
    return dataclasses.replace(carried, mesh=from_mni152(carried.mesh))
