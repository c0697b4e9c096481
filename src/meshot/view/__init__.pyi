from .display import require_display as require_display
from .page import Page as Page, filled as filled, live_page as live_page, still_of as still_of
from .scene import interactive as interactive
from .sheet import Cut as Cut, slice_sheet as slice_sheet
from .slices import (
    LINE_COLOURS as LINE_COLOURS,
    PLANES as PLANES,
    slice_figure as slice_figure,
    slice_image as slice_image,
)
from .surface import surface_figure as surface_figure
from .training import training_figure as training_figure, write_training_figure as write_training_figure
from .values import COLOUR_MAP as COLOUR_MAP, Values as Values
