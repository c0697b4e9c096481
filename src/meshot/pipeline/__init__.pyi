from .examples import InitialSurfaces as InitialSurfaces
from .hemisphere import hemisphere_region as hemisphere_region, restricted as restricted
from .initial_surface import (
    DEPTH_WEIGHT as DEPTH_WEIGHT,
    TissueSurface as TissueSurface,
    tissue_surface as tissue_surface,
)
from .networks import (
    SEGMENTATION as SEGMENTATION,
    TrainedNetworks as TrainedNetworks,
    load_networks as load_networks,
    segmentation_weights as segmentation_weights,
)
from .reconstruction import Reconstruction as Reconstruction, reconstruct as reconstruct
from .stages import Progress as Progress
from .system_training import run_system_training as run_system_training
from .training_files import LOG as LOG, RECORD as RECORD, STATE_FOLDER as STATE_FOLDER, WEIGHTS as WEIGHTS
from .warning_table import average_warnings as average_warnings, warning_names as warning_names
