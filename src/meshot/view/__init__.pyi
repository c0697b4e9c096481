from .display import require_display as require_display
from .page import (
    Page as Page,
    filled as filled,
    live_page as live_page,
    still_of as still_of,
    training_figure as training_figure,
    write_training_figure as write_training_figure,
)
from .scene import interactive as interactive
from .slices import (
    LINE_COLOURS as LINE_COLOURS,
    PLANES as PLANES,
    Cut as Cut,
    slice_figure as slice_figure,
    slice_image as slice_image,
    slice_sheet as slice_sheet,
)
from .style import (
    BLACK as BLACK,
    BLUE as BLUE,
    GREEN as GREEN,
    GREY as GREY,
    LOSS_COLOURS as LOSS_COLOURS,
    LOSS_DASHES as LOSS_DASHES,
    ORANGE as ORANGE,
    PURPLE as PURPLE,
    SKY as SKY,
    SYSTEM_COLOURS as SYSTEM_COLOURS,
    TARGET as TARGET,
    VERMILLION as VERMILLION,
    WIDTH as WIDTH,
    legend_above as legend_above,
    loss_line as loss_line,
    use_style as use_style,
)
from .surface import COLOUR_MAP as COLOUR_MAP, Values as Values, surface_figure as surface_figure
