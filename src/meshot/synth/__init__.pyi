from .imaging import (
    TISSUES as TISSUES,
)
from .imaging import (
    Appearance as Appearance,
)
from .imaging import (
    t1_image as t1_image,
)
from .imaging import (
    tissue_fractions as tissue_fractions,
)
from .position import Position as Position
from .refinement import loop_subdivided as loop_subdivided
from .scanning import Anatomy as Anatomy
from .scanning import simulated_scan as simulated_scan
from .scanning import standardised as standardised
from .subject import Shape as Shape
from .subject import mean_surfaces as mean_surfaces
from .subject import synthetic_subject as synthetic_subject
