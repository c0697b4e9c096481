"""Pictures of the white matter that was given up so that the surface has no handles and no holes."""

import dataclasses

import numpy as np
import scipy.ndimage

from meshot.mesh import Mesh
from meshot.pipeline.reconstruction import Reconstruction
from meshot.pipeline.report.pictures import Picture, layer_picture
from meshot.pipeline.segmentation import in_scanner
from meshot.pipeline.segmentation.surface import SegmentedSurface
from meshot.types import Array, Bool, Float
from meshot.view import PLANES
from meshot.volume import Volume
from meshot.volume.surfaces import isosurface

#: The most pictures, one for each of the largest pieces, and the fewest voxels of a piece that is shown.
MOST_PIECES, FEWEST_VOXELS = 3, 10


@dataclasses.dataclass(frozen=True, eq=False)
class Piece:
    """A connected part of the white matter that was given up.

    Parameters
    ----------
    side : str
    mask : Volume
        In the standard space.
    n_voxels : int
    """

    side: str
    mask: Volume
    n_voxels: int


def given_up_pictures(found: Reconstruction, scan: Volume) -> list[Picture]:
    """Slices of the scan through the largest pieces of white matter that were given up, with their outlines.

    Each piece is shown in the plane in which it is largest. Pieces of fewer than ten voxels are not shown.
    """
    lost = {side: _lost(surface.segmented) for side, surface in found.surfaces.items()}
    pieces = [piece for side, mask in lost.items() for piece in _largest_pieces(side, mask)]
    pieces = sorted(pieces, key=lambda piece: -piece.n_voxels)[:MOST_PIECES]
    outlines = {side: in_scanner(_surface(lost[side]), found.scan) for side in {piece.side for piece in pieces}}
    return [_picture(piece, outlines[piece.side], found, scan) for piece in pieces]


def _lost(segmented: SegmentedSurface) -> Volume:
    return segmented.mask.with_data(segmented.mask.data & ~segmented.genus_zero_mask.data)


def _largest_pieces(side: str, lost: Volume) -> list[Piece]:
    labels, _ = scipy.ndimage.label(lost.data, structure=np.ones((3, 3, 3)))
    counts = np.bincount(labels.ravel())
    counts[0] = 0
    largest = [label for label in np.argsort(-counts)[:MOST_PIECES] if counts[label] >= FEWEST_VOXELS]
    return [Piece(side, lost.with_data(labels == label), int(counts[label])) for label in largest]


def _surface(mask: Volume) -> Mesh:
    return isosurface(mask.with_data(mask.data.astype(float)))


def _picture(piece: Piece, outline: Mesh, found: Reconstruction, scan: Volume) -> Picture:
    final = found.surfaces[piece.side].final
    plane, through = _best_cut(piece.mask.data, found, piece.mask.affine)
    volume = piece.n_voxels * abs(np.linalg.det(piece.mask.affine @ np.linalg.inv(found.scan.to_standard))) / 1000
    what = f"a piece of {volume:.1f} cm³ on the {piece.side}"
    return layer_picture(scan, {"surface": final, "given up": outline}, plane, through, what)


def _best_cut(mask: Bool[Array, "x y z"], found: Reconstruction, affine: Float[Array, "4 4"]) -> tuple[str, np.ndarray]:
    """The plane in which the piece has most voxels in one layer, and a point of that layer in the scanner, in mm."""
    layers = {plane: mask.sum(axis=tuple({0, 1, 2} - {axis})) for plane, (axis, *_) in PLANES.items()}
    plane = max(layers, key=lambda name: layers[name].max())
    axis = PLANES[plane][0]
    inside = np.argwhere(mask)
    middle = inside[inside[:, axis] == int(layers[plane].argmax())].mean(axis=0)
    return plane, (np.linalg.inv(found.scan.to_standard) @ affine @ [*middle, 1.0])[:3]
