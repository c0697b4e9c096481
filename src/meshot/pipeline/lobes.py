"""Whether to trust a reconstruction, lobe by lobe: numbers of each lobe, and what is unusual about it.

A warning says that something is wrong with a scan or a side. Here the place is named. A vertex belongs to the lobe of
the vertex of fsaverage5 that is nearest in MNI152 space. That is good to about a centimetre, and needs no template that
is carried.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
import torch
from scipy.spatial import cKDTree

from meshot.anatomy import HEMISPHERES, Hemisphere, desikan_killiany, fsaverage5_surface, in_mni152
from meshot.mesh import Mesh, vertex_areas
from meshot.pipeline.quality import border_values
from meshot.pipeline.reconstruction import HemisphereSurface, Reconstruction
from meshot.types import PLACEMENTS, Array, Float, Int64
from meshot.volume import Volume, voxel_sizes, voxel_to_mm

#: Regions of the Desikan-Killiany atlas by lobe, as FreeSurfer groups them (``mri_annotation2label --lobes``).
REGIONS_OF_LOBES = {
    "frontal": (
        "superiorfrontal", "rostralmiddlefrontal", "caudalmiddlefrontal", "parsopercularis", "parstriangularis",
        "parsorbitalis", "lateralorbitofrontal", "medialorbitofrontal", "precentral", "paracentral", "frontalpole",
        "rostralanteriorcingulate", "caudalanteriorcingulate",
    ),
    "parietal": (
        "superiorparietal", "inferiorparietal", "supramarginal", "postcentral", "precuneus", "posteriorcingulate",
        "isthmuscingulate",
    ),
    "temporal": (
        "superiortemporal", "middletemporal", "inferiortemporal", "bankssts", "fusiform", "transversetemporal",
        "entorhinal", "temporalpole", "parahippocampal",
    ),
    "occipital": ("lateraloccipital", "lingual", "cuneus", "pericalcarine"),
    "insula": ("insula",),
}  # fmt: skip
LOBES = tuple(REGIONS_OF_LOBES)
#: A vertex that the repair moved farther than this counts as repaired, in mm.
_REPAIRED_MM = 0.5


@dataclasses.dataclass(frozen=True)
class LobeLimit:
    """The usual range of a number of a lobe, and the word for what lies beyond it."""

    word: str
    low: float
    high: float
    about: str


_INF = float("inf")
#: By the name of the number. The limits are the extremes of all lobes of 24 good heads, moved by a fifth of their range
#: (``experiments/warnings/lobes.json``).
LOBE_LIMITS: dict[str, LobeLimit] = {
    "brightness": LobeLimit("bias", 0.727, 1.353, "median of white matter in the lobe over that of both sides"),
    "brighter_inside": LobeLimit("contrast", 0.896, 1.0, "share of the area at which the scan is brighter inside"),
    "given_up_mm3": LobeLimit("cut", 0.0, 1058.0, "volume of white matter that was given up for the topology, in mm³"),
    "repaired": LobeLimit("repaired", 0.0, 0.227, "share of the area that the repair moved by more than 0.5 mm"),
    "from_template_mm": LobeLimit("shape", 0.0, 4.93, "mean distance from fsaverage5's surface in MNI152 space, in mm"),
}


def template_places(mesh: Mesh, side: Hemisphere) -> tuple[Float[Array, " V"], Int64[Array, " V"]]:
    """The distance of every vertex from the nearest one of fsaverage5 in mm, and its lobe: an index of :data:`LOBES`.

    The mesh is in MNI152 space. Vertices near those of no region, as at the cut between the hemispheres, have −1.
    """
    atlas = desikan_killiany(side)
    lobe_of = {region: LOBES.index(lobe) for lobe, regions in REGIONS_OF_LOBES.items() for region in regions}
    lobes = np.array([lobe_of.get(name, -1) for name in atlas.names])[atlas.labels]
    tree = cKDTree(fsaverage5_surface("white", side, "MNI152").vertices.double().numpy())
    distances, nearest = tree.query(mesh.vertices.detach().double().cpu().numpy())
    return distances, lobes[nearest]


def lobe_numbers(found: Reconstruction, scan: Volume) -> dict[Hemisphere, dict[str, dict[str, float]]]:
    """The numbers of each lobe, by side and lobe: see :data:`LOBE_LIMITS`.

    Parameters
    ----------
    found : Reconstruction
    scan : Volume
        The scan in scanner RAS.
    """
    values = {side: border_values(scan, each.final) for side, each in found.surfaces.items()}
    usual = float(np.median(np.concatenate([inside for inside, _ in values.values()])))
    return {side: _of_side(found, side, *values[side], usual) for side in HEMISPHERES if side in found.surfaces}


def _of_side(
    found: Reconstruction, side: Hemisphere, inside: Array, outside: Array, usual: float
) -> dict[str, dict[str, float]]:
    surface = found.surfaces[side]
    areas = vertex_areas(surface.final).detach().cpu().numpy()
    placed = surface.final.with_vertices(found.scan.from_scanner(surface.final.vertices.double()))
    away, lobes = template_places(_in_mni152(placed, found), side)
    moved = np.zeros(len(areas), dtype=bool)
    if surface.unrepaired is not None:
        moved = (surface.final.vertices - surface.unrepaired.vertices).norm(dim=1).cpu().numpy() > _REPAIRED_MM
    given_up, voxel_mm3 = _given_up(surface, side, found)
    numbers = {}
    for index, lobe in enumerate(LOBES):
        here = lobes == index
        area = float(areas[here].sum())
        if not area:  # nothing of this side lies near this lobe
            numbers[lobe] = dict.fromkeys(LOBE_LIMITS, float("nan")) | {"area_mm2": 0.0}
            continue
        share = areas[here] / area
        numbers[lobe] = {
            "area_mm2": area,
            "brightness": float(np.median(inside[here])) / usual if usual else float("nan"),
            "brighter_inside": float(share @ (inside > outside)[here]),
            "given_up_mm3": float((given_up == index).sum() * voxel_mm3),
            "repaired": float(share @ moved[here]),
            "from_template_mm": float(share @ away[here]),
        }
    return numbers


def _given_up(surface: HemisphereSurface, side: Hemisphere, found: Reconstruction) -> tuple[Int64[Array, " n"], float]:
    """The lobe of every voxel of white matter that was given up, and the volume of a voxel in the scanner."""
    whole, mesh = surface.segmented.mask, surface.segmented.mesh
    volume = float(np.prod(voxel_sizes(whole)) / abs(np.linalg.det(found.scan.to_standard[:3, :3])))
    places = np.argwhere(whole.data & ~surface.segmented.genus_zero_mask.data)
    if not len(places):
        return np.zeros(0, dtype=np.int64), volume
    lobes = template_places(_in_mni152(mesh, found), side)[1]
    points = voxel_to_mm(whole, torch.from_numpy(places).double()).numpy()
    return lobes[cKDTree(mesh.vertices.double().numpy()).query(points)[1]], volume


def _in_mni152(mesh: Mesh, found: Reconstruction) -> Mesh:
    """A mesh of the standard space, which is enlarged if scans are placed by their white matter, in MNI152 space."""
    return mesh if found.placement == PLACEMENTS[0] else in_mni152(mesh)


def doubts_of_lobes(numbers: Mapping[str, Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, list[str]]]:
    """What is unusual about each lobe, by side and lobe: words of :data:`LOBE_LIMITS`, such as "cut".

    Lobes without a doubt are left out. What is no number is unusual.
    """
    found: dict[str, dict[str, list[str]]] = {}
    for side, lobes in numbers.items():
        for lobe, values in lobes.items():
            words = [each.word for name, each in LOBE_LIMITS.items() if not each.low <= values[name] <= each.high]
            if words:
                found.setdefault(side, {})[lobe] = words
    return found


def doubts_in_words(doubts: Mapping[str, Mapping[str, list[str]]]) -> str:
    """Doubts as one line, such as ``left frontal (cut, shape); right insula (contrast)``; empty without any."""
    return "; ".join(
        f"{side} {lobe} ({', '.join(words)})" for side, lobes in doubts.items() for lobe, words in lobes.items()
    )
