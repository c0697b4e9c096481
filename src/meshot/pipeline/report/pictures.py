"""The pictures of a reconstruction: slices with outlines, and an interactive view of the surfaces."""

import dataclasses
from collections.abc import Iterator

import numpy as np
import torch
from scipy.ndimage import affine_transform

from meshot.mesh import Mesh
from meshot.pipeline.reconstruction import Reconstruction
from meshot.types import Array, Float
from meshot.view import LINE_COLOURS, PLANES, Cut, interactive, slice_figure, slice_sheet, still_of
from meshot.volume import Volume, voxel_sizes

_MARGIN_MM = 12.0
_WIDTH_INCHES = 5.6
_HEADROOM = 1.4  # white matter is shown as light grey, so that the lines stand out
#: Planes, and positions along their axis as fractions of the extent of the surfaces.
_CUTS = (
    ("axial", 0.45), ("axial", 0.65), ("coronal", 0.4), ("coronal", 0.6), ("sagittal", 0.3), ("sagittal", 0.7),
)  # fmt: skip


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
    """One slice of the original scan around some surfaces.

    Parameters
    ----------
    scan : Volume
    meshes : dict
        Surfaces by name, in scanner RAS.
    plane : str
    through : array
        A point of the slice, in scanner RAS, in mm.
    what : str
        What the slice goes through, for the alternative text.
    """
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
    return {name: _together(parts) for name, parts in stages.items()}


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
    to_voxel = np.linalg.inv(scan.affine) @ affine
    values = scan.data.astype(np.float32)
    darkest = float(values.min())
    return Volume(affine_transform(values, to_voxel[:3, :3], to_voxel[:3, 3], shape, order=1, cval=darkest), affine)


def surface_view(found: Reconstruction, distances: dict[str, Float[Array, " V"]]) -> str:
    """The final surfaces, coloured by their distance from the initial ones, as HTML.

    Parameters
    ----------
    found : Reconstruction
    distances : dict
        The distance of every vertex in mm, by side.

    Returns
    -------
    str
        If no OpenGL is available, a paragraph that says so.
    """
    meshes = {side: surface.final for side, surface in found.surfaces.items()}
    alt = "The white surfaces of the left and the right hemisphere"
    try:
        if not found.system:
            return interactive(meshes, alt=f"{alt}, as the segmentation has them.").html
        limit = max(float(np.percentile(numbers, 99)) for numbers in distances.values())
        return interactive(
            meshes, distances, alt=f"{alt}, coloured by the distance from the initial surface.",
            label="distance from the initial surface", limits=(0.0, max(round(limit, 1), 0.1)),
        ).html  # fmt: skip
    except RuntimeError as error:  # no OpenGL here
        return f"<p>{error}</p>"


def _together(meshes: list[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + int(start) for mesh, start in zip(meshes, starts)]
    return Mesh(torch.cat([mesh.vertices for mesh in meshes]), torch.cat(faces))
