from .deformation import N_STEPS as N_STEPS
from .deformation import DeformationNetwork as DeformationNetwork
from .overlap import segmentation_loss as segmentation_loss
from .overlap import soft_dice as soft_dice
from .segmentation import SegmentationNetwork as SegmentationNetwork
from .weights import (
    network_digest as network_digest,
)
from .weights import (
    read_weights as read_weights,
)
from .weights import (
    require_small as require_small,
)
from .weights import (
    write_weights as write_weights,
)
