from .examples import InitialSurfaces as InitialSurfaces
from .hemisphere import hemisphere_region as hemisphere_region
from .hemisphere import restricted as restricted
from .initial_surface import (
    DEPTH_WEIGHT as DEPTH_WEIGHT,
)
from .initial_surface import (
    TissueSurface as TissueSurface,
)
from .initial_surface import (
    tissue_surface as tissue_surface,
)
from .networks import SEGMENTATION as SEGMENTATION
from .networks import load_networks as load_networks
from .networks import segmentation_weights as segmentation_weights
from .reconstruction import reconstruct as reconstruct
from .system_training import run_system_training as run_system_training
from .training_files import LOG as LOG
from .training_files import RECORD as RECORD
from .training_files import STATE_FOLDER as STATE_FOLDER
from .training_files import WEIGHTS as WEIGHTS
