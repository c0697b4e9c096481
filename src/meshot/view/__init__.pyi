from .display import require_display as require_display
from .page import Page as Page
from .page import filled as filled
from .page import live_page as live_page
from .page import still_of as still_of
from .scene import interactive as interactive
from .slices import (
    LINE_COLOURS as LINE_COLOURS,
)
from .slices import (
    PLANES as PLANES,
)
from .slices import (
    slice_figure as slice_figure,
)
from .slices import (
    slice_image as slice_image,
)
from .surface import surface_figure as surface_figure
from .training import training_figure as training_figure
from .training import write_training_figure as write_training_figure
from .values import COLOUR_MAP as COLOUR_MAP
from .values import Values as Values
