from .deformation import N_STEPS as N_STEPS, DeformationNetwork as DeformationNetwork, ImageVelocity as ImageVelocity
from .overlap import segmentation_loss as segmentation_loss, soft_dice as soft_dice
from .segmentation import SegmentationNetwork as SegmentationNetwork
from .weights import (
    network_digest as network_digest,
    read_weights as read_weights,
    require_small as require_small,
    write_weights as write_weights,
)
