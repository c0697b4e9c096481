from .blemishes import Blemishes as Blemishes
from .imaging import (
    TISSUES as TISSUES,
    Appearance as Appearance,
    t1_image as t1_image,
    tissue_fractions as tissue_fractions,
)
from .position import Position as Position
from .refinement import loop_subdivided as loop_subdivided
from .scanning import Anatomy as Anatomy, simulated_scan as simulated_scan, standardised as standardised
from .subject import (
    CorticalSurfaces as CorticalSurfaces,
    Shape as Shape,
    mean_surfaces as mean_surfaces,
    synthetic_subject as synthetic_subject,
)
