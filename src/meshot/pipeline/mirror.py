"""Results for a scan and for its mirror image, averaged, so that neither side is treated differently.

A network of the left side and one of the right side learned from different hemispheres. So the surfaces of a mirrored
scan are not the mirror images of those of the scan. Their average is the same for both.
"""

import numpy as np

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.mesh import Mesh
from meshot.metrics import corresponds
from meshot.model import SegmentationNetwork
from meshot.pipeline.segmentation import segment
from meshot.systems import Scan, SurfaceKey, SurfaceSystem
from meshot.volume import Volume

OTHER: dict[Hemisphere, Hemisphere] = dict(zip(HEMISPHERES, HEMISPHERES[::-1], strict=True))


def mirrored(volume: Volume) -> Volume:
    """A volume whose first axis is reversed, at the same place."""
    return volume.with_data(np.ascontiguousarray(volume.data[::-1]))


def mirrored_mesh(mesh: Mesh, grid: Volume) -> Mesh:
    """A mesh with outward normals, mirrored as the volume of that grid. The first axis of the grid is that of x."""
    middle = float(grid.affine[0, 3] + grid.affine[0, 0] * (grid.data.shape[0] - 1) / 2)
    vertices = mesh.vertices.clone()
    vertices[:, 0] = 2 * middle - vertices[:, 0]
    return Mesh(vertices, mesh.faces.flip(1))


def segment_both_ways(scan: Volume, network: SegmentationNetwork) -> dict[Hemisphere, Volume]:
    """The probability of white matter of each side: see :func:`meshot.pipeline.segment`."""
    found, other = segment(scan, network), segment(mirrored(scan), network)
    return {
        side: scan.with_data((volume.data + mirrored(other[OTHER[side]]).data) / 2) for side, volume in found.items()
    }


def find_both_ways(system: SurfaceSystem, scan: Scan) -> dict[SurfaceKey, Mesh]:
    """The surfaces of a system: the mean positions of their vertices, if vertices correspond, or else as they are."""
    found = system.reconstruct(scan)
    initial = {(OTHER[side], kind): mirrored_mesh(mesh, scan.image) for (side, kind), mesh in scan.initial.items()}
    other = system.reconstruct(Scan(mirrored(scan.image), initial))
    for (side, kind), mesh in found.items():
        back = mirrored_mesh(other[OTHER[side], kind], scan.image)
        if corresponds(mesh, back):
            found[side, kind] = mesh.with_vertices((mesh.vertices + back.vertices) / 2)
    return found
