from .hemisphere import hemisphere_region as hemisphere_region, restricted as restricted
from .initial_surface import (
    DEPTH_WEIGHT as DEPTH_WEIGHT,
    TissueSurface as TissueSurface,
    tissue_surface as tissue_surface,
)
from .networks import SEGMENTATION as SEGMENTATION, load_networks as load_networks, weights_path as weights_path
from .reconstruction import reconstruct as reconstruct
from .training_files import LOG as LOG, RECORD as RECORD, STATE_FOLDER as STATE_FOLDER, WEIGHTS as WEIGHTS
