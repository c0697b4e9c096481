from .cohort import (
    LABELS as LABELS,
)
from .cohort import (
    Subject as Subject,
)
from .cohort import (
    participants as participants,
)
from .cohort import (
    read_subject as read_subject,
)
from .cohort import (
    scans as scans,
)
from .generation import make_cohort as make_cohort
from .generation import open_cohort as open_cohort
from .generation import visits as visits
from .manifest import changed_files as changed_files
from .manifest import keep_digests as keep_digests
from .recipe import (
    Recipe as Recipe,
)
from .recipe import (
    drawn_appearance as drawn_appearance,
)
from .recipe import (
    drawn_shape as drawn_shape,
)
from .recipe import (
    read_recipe as read_recipe,
)
