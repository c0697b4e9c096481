from .deformation import (
    arms_figure as arms_figure,
    deformation_view as deformation_view,
    histogram_figure as histogram_figure,
    trade_off_figure as trade_off_figure,
)
from .flow import (
    FIELDS as FIELDS,
    bent_grid_figure as bent_grid_figure,
    cell_areas as cell_areas,
    contour_data as contour_data,
    crossing_data as crossing_data,
    crossing_figure as crossing_figure,
    map_figure as map_figure,
    outlines as outlines,
    share_figure as share_figure,
    steps_figure as steps_figure,
    trajectory_figure as trajectory_figure,
    two_triangles as two_triangles,
    velocity_figure as velocity_figure,
)
