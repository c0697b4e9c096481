from .directions import directions_figure as directions_figure
from .force import ForceField as ForceField
from .force import force_panels as force_panels
from .player import point_player as point_player
from .points import (
    curves_figure as curves_figure,
)
from .points import (
    draw_contour as draw_contour,
)
from .points import (
    draw_points as draw_points,
)
from .points import (
    force_figure as force_figure,
)
from .points import (
    process_figure as process_figure,
)
