"""The surfaces that the networks find on the MNI152 average, against those of its white-matter map.

The row is not independent: everything outside the cortex of the training heads comes from this average.
"""

import numpy as np

from meshot.anatomy import HEMISPHERES, Hemisphere, fsaverage5_surface, mni152_t1, mni152_white_matter
from meshot.mesh import Mesh, face_areas
from meshot.metrics import Surface, average_surface_distance, offsets_between
from meshot.pipeline import TrainedNetworks, reconstruct
from meshot_book.tissue import hemisphere_region, restricted, tissue_surface


def map_surface(side: Hemisphere) -> Mesh:
    """The surface of the white-matter map within the region of chapter 36, where it is one half."""
    white, pial = (fsaverage5_surface(kind, side) for kind in ("white", "pial"))
    return tissue_surface(restricted(mni152_white_matter(), hemisphere_region(mni152_t1(), white, pial, side))).mesh


def against(mesh: Mesh, target: Mesh, config: dict) -> dict:
    """Average distance both ways, the median from the target to the mesh, and the ratio of the areas."""
    there, back = offsets_between(
        Surface(mesh), Surface(target), config["n_points"], (config["seed"], config["seed"] + 1)
    )
    return {
        "assd_mm": average_surface_distance(there, back),
        "median_from_target_mm": float(np.median(back.distances)),
        "area_ratio": float(face_areas(mesh).sum() / face_areas(target).sum()),
    }


def measured_average(networks: TrainedNetworks, config: dict) -> dict:
    """Both sides, initial and final surfaces."""
    made = reconstruct(mni152_t1(), networks.segmentation, networks.system)
    found: dict = {}
    for side in HEMISPHERES:
        target, surfaces = map_surface(side), made.surfaces[side]
        found[side] = {stage: against(getattr(surfaces, stage), target, config) for stage in ("initial", "final")}
    return found
