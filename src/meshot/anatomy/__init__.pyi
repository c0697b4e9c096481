from .templates import (
    HEMISPHERES as HEMISPHERES,
)
from .templates import (
    Hemisphere as Hemisphere,
)
from .templates import (
    fsaverage5_surface as fsaverage5_surface,
)
from .templates import (
    mni152_brain_mask as mni152_brain_mask,
)
from .templates import (
    mni152_t1 as mni152_t1,
)
from .templates import (
    mni152_white_matter as mni152_white_matter,
)
