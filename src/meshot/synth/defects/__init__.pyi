from .planted import (
    inflated as inflated,
)
from .planted import (
    noisy as noisy,
)
from .planted import (
    shifted as shifted,
)
from .planted import (
    unevenly_sampled as unevenly_sampled,
)
from .planted import (
    with_blurred_folds as with_blurred_folds,
)
from .planted import (
    with_flipped_faces as with_flipped_faces,
)
from .planted import (
    with_hole as with_hole,
)
from .planted import (
    with_spike as with_spike,
)
from .sulcal_walls import facing_walls as facing_walls
from .sulcal_walls import with_bridge as with_bridge
from .sulcal_walls import with_crossing as with_crossing
