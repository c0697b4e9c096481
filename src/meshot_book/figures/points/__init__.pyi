from .points import (
    ForceField as ForceField,
    curves_figure as curves_figure,
    directions_figure as directions_figure,
    draw_contour as draw_contour,
    draw_points as draw_points,
    force_figure as force_figure,
    force_panels as force_panels,
    process_figure as process_figure,
)
