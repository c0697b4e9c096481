from .cohorts import (
    LABELS as LABELS,
    Subject as Subject,
    participants as participants,
    read_subject as read_subject,
    scans as scans,
)
from .generation import (
    changed_files as changed_files,
    keep_digests as keep_digests,
    make_cohort as make_cohort,
    open_cohort as open_cohort,
    visits as visits,
)
from .heads import (
    CarriedHead as CarriedHead,
    Leaves as Leaves,
    TemplateTissue as TemplateTissue,
    template_tissue as template_tissue,
)
from .imaging import (
    TISSUES as TISSUES,
    Appearance as Appearance,
    Blemishes as Blemishes,
    t1_image as t1_image,
    tissue_fractions as tissue_fractions,
)
from .recipe import (
    People as People,
    Recipe as Recipe,
    drawn_appearance as drawn_appearance,
    drawn_shape as drawn_shape,
    read_recipe as read_recipe,
)
from .scanning import (
    Anatomy as Anatomy,
    Position as Position,
    simulated_scan as simulated_scan,
    standardised as standardised,
)
from .subject import (
    CorticalSurfaces as CorticalSurfaces,
    Shape as Shape,
    crossing_faces as crossing_faces,
    loop_subdivided as loop_subdivided,
    mean_surfaces as mean_surfaces,
    synthetic_subject as synthetic_subject,
)
