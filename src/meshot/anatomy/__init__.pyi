from .contrast import contrast_by_white_matter as contrast_by_white_matter
from .placement import (
    ENLARGEMENT as ENLARGEMENT,
    from_mni152 as from_mni152,
    in_mni152 as in_mni152,
    placed_by_white_matter as placed_by_white_matter,
)
from .templates import (
    HEMISPHERES as HEMISPHERES,
    MNI305_TO_MNI152 as MNI305_TO_MNI152,
    Hemisphere as Hemisphere,
    fsaverage5_surface as fsaverage5_surface,
    mni152_brain_mask as mni152_brain_mask,
    mni152_grey_matter as mni152_grey_matter,
    mni152_t1 as mni152_t1,
    mni152_white_matter as mni152_white_matter,
)
