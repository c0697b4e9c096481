from .data import example as example, reduced_volume as reduced_volume
from .files import run_segmentation_training as run_segmentation_training
from .segmenting import in_scanner as in_scanner, segment as segment
from .settings import segmentation_config as segmentation_config
from .surface import PROBABILITY_WEIGHT_MM as PROBABILITY_WEIGHT_MM, segmented_surface as segmented_surface
from .training import train_segmentation as train_segmentation
