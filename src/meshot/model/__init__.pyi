from .deformation import (
    N_STEPS as N_STEPS,
    DeformationNetwork as DeformationNetwork,
    ImageVelocity as ImageVelocity,
    Intensities as Intensities,
)
from .features import (
    FeatureNetwork as FeatureNetwork,
    GraphConvolution as GraphConvolution,
    ResidualGraphBlock as ResidualGraphBlock,
    sample_features as sample_features,
)
from .segmentation import (
    CLASSES as CLASSES,
    SegmentationNetwork as SegmentationNetwork,
    folded as folded,
    initialise as initialise,
    segmentation_loss as segmentation_loss,
    soft_dice as soft_dice,
    unfolded as unfolded,
)
from .weights import (
    halve_weights as halve_weights,
    network_digest as network_digest,
    read_weights as read_weights,
    require_small as require_small,
    write_weights as write_weights,
)
