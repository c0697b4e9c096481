"""The HTML page of a reconstruction: one file, usable offline, for light and dark mode and all screen widths."""

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
import scipy.ndimage
import torch

from meshot.mesh import Mesh
from meshot.metrics import LARGEST_THICKNESS_MM, corresponds, cortical_thickness
from meshot.pipeline.lobes import LOBES
from meshot.pipeline.reconstruction import Reconstruction
from meshot.pipeline.segmentation import in_scanner
from meshot.types import Array, Float
from meshot.view import LINE_COLOURS, PLANES, Cut, filled, interactive, slice_figure, slice_sheet, still_of
from meshot.volume import Volume, isosurface, resample, voxel_sizes

# The pictures of a reconstruction: slices with outlines, and an interactive view of the surfaces.

_MARGIN_MM = 12.0
_WIDTH_INCHES = 5.6
_HEADROOM = 1.4  # white matter is shown as light grey, so that the lines stand out
#: Planes, and positions along their axis as fractions of the extent of the surfaces.
_CUTS = (
    ("axial", 0.45),
    ("axial", 0.65),
    ("coronal", 0.4),
    ("coronal", 0.6),
    ("sagittal", 0.3),
    ("sagittal", 0.7),
)


@dataclasses.dataclass(frozen=True)
class Picture:
    """A picture for the page: a PNG in base64, and its alternative text."""

    png: str
    alt: str


def slice_pictures(found: Reconstruction, scan: Volume) -> list[Picture]:
    """Slices of the original scan, two in each plane, with outlines of the initial, final and pial surfaces."""
    meshes, limits = _meshes(found), _limits(scan)
    pictures = []
    for (plane, _), (slab, through) in zip(_CUTS, _slabs(meshes, scan), strict=True):
        figure = slice_figure(slab, meshes, through, (plane,), limits, _WIDTH_INCHES)
        alt = f"{_place(plane, through)}, with the outline of the {' and the '.join(meshes)}"
        pictures.append(Picture(still_of(figure), alt))
    return pictures


def layer_picture(scan: Volume, meshes: dict[str, Mesh], plane: str, through: Float[Array, " 3"], what: str) -> Picture:
    """One slice of the original scan around some surfaces."""
    vertices = torch.cat([mesh.vertices for mesh in meshes.values()]).numpy()
    box = vertices.min(axis=0), vertices.max(axis=0)
    slab = _slab(scan, box, PLANES[plane][0], float(through[PLANES[plane][0]]))
    figure = slice_figure(slab, meshes, through, (plane,), _limits(scan), _WIDTH_INCHES)
    return Picture(still_of(figure), f"{_place(plane, through)}, through {what}, with its outline")


def _place(plane: str, through: Float[Array, " 3"]) -> str:
    axis = PLANES[plane][0]
    return f"{plane.capitalize()} slice of the scan at {'xyz'[axis]} = {through[axis]:.0f} mm"


def overview(found: Reconstruction, scan: Volume) -> bytes:
    """The slices of :func:`slice_pictures` in one small WebP file without labels, with the outline of the result."""
    meshes = _meshes(found)
    cuts = [
        Cut(slab, plane, float(through[PLANES[plane][0]]))
        for (plane, _), (slab, through) in zip(_CUTS, _slabs(meshes, scan), strict=True)
    ]
    shown = 1 if found.system else 0  # the white surface
    ordered = [*cuts[::2], *cuts[1::2]]  # a plane in every column
    return slice_sheet(ordered, list(meshes.values())[shown], _limits(scan), LINE_COLOURS[shown])


def _meshes(found: Reconstruction) -> dict[str, Mesh]:
    """Both hemispheres as one mesh, by stage."""
    stages = {"initial surface": [s.initial for s in found.surfaces.values()]}
    if found.system:
        stages["final surface"] = [s.final for s in found.surfaces.values()]
    pial = [s.pial for s in found.surfaces.values() if s.pial is not None]
    stages |= {"pial surface": pial} if pial else {}
    found = {}
    for name, parts in stages.items():
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in parts)])
        faces = [mesh.faces + int(start) for mesh, start in zip(parts, starts)]
        found[name] = Mesh(torch.cat([mesh.vertices for mesh in parts]), torch.cat(faces))
    return found


def _limits(scan: Volume) -> tuple[float, float]:
    dark, bright = np.percentile(scan.data, [1, 99])
    return float(dark), float(dark + _HEADROOM * max(bright - dark, 1e-6))


def _slabs(meshes: dict[str, Mesh], scan: Volume) -> Iterator[tuple[Volume, np.ndarray]]:
    """The layer of every cut, and the point that it goes through."""
    vertices = torch.cat([mesh.vertices for mesh in meshes.values()]).numpy()
    box = vertices.min(axis=0), vertices.max(axis=0)
    for plane, share in _CUTS:
        axis = PLANES[plane][0]
        through = (box[0] + box[1]) / 2
        through[axis] = box[0][axis] + share * (box[1][axis] - box[0][axis])
        yield _slab(scan, box, axis, through[axis]), through


def _slab(scan: Volume, box: tuple[np.ndarray, np.ndarray], axis: int, position: float) -> Volume:
    """One axis-aligned layer of the scan, resampled around the surfaces."""
    low, high = box[0] - _MARGIN_MM, box[1] + _MARGIN_MM
    low[axis] = high[axis] = position
    spacing = float(voxel_sizes(scan).min())
    affine = np.diag([spacing] * 3 + [1.0])
    affine[:3, 3] = low
    shape = tuple(int(n) + 1 for n in (high - low) / spacing)
    return resample(scan, shape, affine, outside="lowest")


def surface_view(found: Reconstruction, distances: dict[str, Float[Array, " V"]]) -> str:
    """The final surfaces, coloured by the thickness of the cortex or the distance from the initial ones, as HTML."""
    meshes = {side: surface.final for side, surface in found.surfaces.items()}
    alt = "The white surfaces of the left and the right hemisphere"
    try:
        if not found.system:
            return interactive(meshes, alt=f"{alt}, as the segmentation has them.").html
        if all(corresponds(surface.final, surface.pial) for surface in found.surfaces.values()):
            return interactive(
                meshes,
                {side: cortical_thickness(surface.final, surface.pial) for side, surface in found.surfaces.items()},
                alt=f"{alt}, coloured by the thickness of the cortex.",
                label="thickness of the cortex",
                limits=(0.0, LARGEST_THICKNESS_MM),
            ).html
        limit = max(float(np.percentile(numbers, 99)) for numbers in distances.values())
        return interactive(
            meshes,
            distances,
            alt=f"{alt}, coloured by the distance from the initial surface.",
            label="distance from the initial surface",
            limits=(0.0, max(round(limit, 1), 0.1)),
        ).html
    except RuntimeError as error:  # no OpenGL here
        return f"<p>{error}</p>"


Rows = list[tuple]


def reconstruction_page(
    report: dict,
    slices: Sequence[Picture],
    given_up: Sequence[Picture],
    view: str,
    files: Sequence[tuple[Sequence[str], str]],
) -> str:
    """The page as HTML. ``files``: names beside the page, and what these are."""
    surfaces = report["surfaces"]
    meshes = [
        ("vertices", "n_vertices"),
        ("faces", "n_faces"),
        ("Euler number χ (a sphere has 2)", "euler_number"),
        ("edges of one face only", "n_boundary_edges"),
        ("edges of more than two faces", "n_nonmanifold_edges"),
        ("self-intersecting faces", "n_self_intersecting_faces"),
        ("volume inside (cm³)", "volume_cm3"),
        ("area (cm²)", "area_cm2"),
    ]
    stages = (("initial", "final") if report["system"] else ("initial",)) + ("pial",) * _has_pial(report)
    columns = [(side, stage) for side in surfaces for stage in stages]
    rows = [(label, *(_cell(surfaces[side][stage][key]) for side, stage in columns)) for label, key in meshes]
    # The times: a header, a row for each stage, and the total.
    clocks = [report["seconds"]["processor"], report["seconds"]["clock"]]
    seconds = [(stage, *(_cell(clock[stage]) for clock in clocks)) for stage in clocks[0]]
    seconds.append(("in all", *(_cell(sum(clock.values())) for clock in clocks)))
    records = []
    for name, record in report["weights"].items():
        known = [f"{key} {record[key]}" for key in ("commit", "date", "cohorts", "command") if key in record]
        records.append(f"{name}: {'; '.join(known) or 'no record'}")
    return filled(
        "meshot/pipeline/assets/report.html",
        report=report,
        slices=slices,
        given_up=given_up,
        view=view,
        meshes=[("", *(f"{side}, {stage}" for side, stage in columns)), *rows],
        pial=_has_pial(report),
        thick=_has_pial(report) and all(s["pial"]["mean_thickness_mm"] is not None for s in surfaces.values()),
        files=files,
        moves=_move_rows(report),
        lobes=_lobe_rows(report),
        voxel_mm=" × ".join(f"{v:g}" for v in report["scan"]["voxel_mm"]),
        seconds=[("stage", "processor (s)", "clock (s)"), *seconds],
        matrix="\n".join(" ".join(f"{value:11.6f}" for value in row) for row in report["to_standard"]),
        records="\n".join(records),
    )


def _has_pial(report: dict) -> bool:
    return all(numbers.get("pial") for numbers in report["surfaces"].values())


def _move_rows(report: dict) -> Rows:
    """The table of deformation and repair: a header, and a row for each number of a hemisphere."""
    sides = report["surfaces"].values()
    rows = []
    if report["system"]:
        words = {"mean": "mean", "percentile_95": "95 % below", "largest": "largest"}
        rows = [
            (f"distance from the initial surface, {word} (mm)", *(s["distance_from_initial_mm"][key] for s in sides))
            for key, word in words.items()
        ]
    if _has_pial(report):
        away = [s["pial"]["distance_from_white_mm"] for s in sides]
        rows += [("distance of the pial from the final surface, mean (mm)", *(found["mean"] for found in away))]
        if all(s["pial"]["mean_thickness_mm"] is not None for s in sides):
            rows += [
                ("mean thickness of the cortex (mm)", *(s["pial"]["mean_thickness_mm"] for s in sides)),
                ("volume of the cortex (cm³)", *(s["pial"]["cortex_volume_cm3"] for s in sides)),
            ]
    repairs = [s["repair"] for s in sides]
    if all(repairs):
        rows += [
            ("faces that crossed after the flow, before the repair", *(m["n_faces_crossing_before"] for m in repairs)),
            ("largest move by the repair (mm)", *(m["largest_move_mm"] for m in repairs)),
        ]
    carried = [s["fsaverage5"] for s in sides]
    if all(carried):
        rows += [
            ("distance of fsaverage5 carried here, mean (mm)", *(c["distance_mm"] for c in carried)),
            ("its faces that crossed before they were smoothed", *(c["n_faces_crossing_before"] for c in carried)),
            ("its self-intersecting faces", *(c["n_self_intersecting_faces"] for c in carried)),
        ]
    rows += [
        ("voxels given up for the topology of a ball", *(s["n_voxels_given_up"] for s in sides)),
        ("these, of the white matter (%)", *(100 * s["share_of_voxels_given_up"] for s in sides)),
    ]
    return [("", *report["surfaces"]), *((label, *map(_cell, values)) for label, *values in rows)]


def _lobe_rows(report: dict) -> Rows:
    """The table of doubts: a header, and a row for each lobe with what is unusual about it on each side."""
    doubts = report["doubts"]
    cells = {side: [", ".join(doubts.get(side, {}).get(lobe, [])) or "–" for lobe in LOBES] for side in report["lobes"]}
    return [("", *cells), *zip(LOBES, *cells.values(), strict=True)]


def _cell(value: float) -> str:
    if isinstance(value, float) and not abs(value) >= 1000:
        text = f"{value:.3g}"
        return "0" if float(text) == 0 else text  # never a minus zero
    return f"{round(value):,}".replace(",", "\u202f")


# Pictures of the white matter that was given up so that the surface has no handles and no holes.

#: The most pictures, one for each of the largest pieces, and the fewest voxels of a piece that is shown.
MOST_PIECES, FEWEST_VOXELS = 3, 10


def given_up_pictures(found: Reconstruction, scan: Volume) -> list[Picture]:
    """Slices of the scan through the largest pieces of white matter that were given up, with their outlines."""
    # Each piece is shown in the plane in which it is largest. Pieces of fewer than ten voxels are not shown.
    lost, pieces = {}, []
    for side, surface in found.surfaces.items():
        whole = surface.segmented.mask
        lost[side] = whole.with_data(whole.data & ~surface.segmented.genus_zero_mask.data)
        labels, _ = scipy.ndimage.label(lost[side].data, structure=np.ones((3, 3, 3)))
        counts = np.bincount(labels.ravel())
        counts[0] = 0
        largest = [label for label in np.argsort(-counts)[:MOST_PIECES] if counts[label] >= FEWEST_VOXELS]
        pieces += [(side, labels == label, int(counts[label])) for label in largest]
    pieces = sorted(pieces, key=lambda piece: -piece[2])[:MOST_PIECES]
    outlines = {}
    for side in {side for side, _, _ in pieces}:
        solid = lost[side].with_data(lost[side].data.astype(float))
        outlines[side] = in_scanner(isosurface(solid), found.scan)
    to_scanner, pictures = np.linalg.inv(found.scan.to_standard), []
    for side, mask, n_voxels in pieces:
        # The plane in which the piece has most voxels in one layer, and a point of that layer in the scanner, in mm.
        layers = {plane: mask.sum(axis=tuple({0, 1, 2} - {axis})) for plane, (axis, *_) in PLANES.items()}
        plane = max(layers, key=lambda name, layers=layers: layers[name].max())
        inside, affine = np.argwhere(mask), lost[side].affine
        middle = inside[inside[:, PLANES[plane][0]] == int(layers[plane].argmax())].mean(axis=0)
        through = (to_scanner @ affine @ [*middle, 1.0])[:3]
        volume = n_voxels * abs(np.linalg.det(affine @ to_scanner)) / 1000
        meshes = {"surface": found.surfaces[side].final, "given up": outlines[side]}
        pictures.append(layer_picture(scan, meshes, plane, through, f"a piece of {volume:.1f} cm³ on the {side}"))
    return pictures
