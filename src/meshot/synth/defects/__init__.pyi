from .planted import (
    inflated as inflated,
    noisy as noisy,
    shifted as shifted,
    unevenly_sampled as unevenly_sampled,
    with_blurred_folds as with_blurred_folds,
    with_flipped_faces as with_flipped_faces,
    with_hole as with_hole,
    with_spike as with_spike,
)
from .sulcal_walls import facing_walls as facing_walls, with_bridge as with_bridge, with_crossing as with_crossing
