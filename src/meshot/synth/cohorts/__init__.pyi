from .cohort import (
    LABELS as LABELS,
    Subject as Subject,
    participants as participants,
    read_subject as read_subject,
    scans as scans,
)
from .generation import make_cohort as make_cohort, open_cohort as open_cohort, visits as visits
from .manifest import changed_files as changed_files, keep_digests as keep_digests
from .people import People as People
from .recipe import (
    Recipe as Recipe,
    drawn_appearance as drawn_appearance,
    drawn_shape as drawn_shape,
    read_recipe as read_recipe,
)
