from .directions import directions_figure as directions_figure
from .force import ForceField as ForceField, force_panels as force_panels
from .player import point_player as point_player
from .points import (
    curves_figure as curves_figure,
    draw_contour as draw_contour,
    draw_points as draw_points,
    force_figure as force_figure,
    process_figure as process_figure,
)
