from .regions import Parcellation as Parcellation, desikan_killiany as desikan_killiany
from .templates import (
    ENLARGEMENT as ENLARGEMENT,
    HEMISPHERES as HEMISPHERES,
    MNI305_TO_MNI152 as MNI305_TO_MNI152,
    Hemisphere as Hemisphere,
    contrast_by_white_matter as contrast_by_white_matter,
    enlarged as enlarged,
    from_mni152 as from_mni152,
    fsaverage5_surface as fsaverage5_surface,
    in_mni152 as in_mni152,
    mni152_brain_mask as mni152_brain_mask,
    mni152_grey_matter as mni152_grey_matter,
    mni152_t1 as mni152_t1,
    mni152_white_matter as mni152_white_matter,
    placed_by_white_matter as placed_by_white_matter,
)
