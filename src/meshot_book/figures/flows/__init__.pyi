from .crossing import crossing_player as crossing_player, outlines as outlines, two_triangles as two_triangles
from .deformation import deformation_view as deformation_view
from .deformation_charts import (
    arms_figure as arms_figure,
    histogram_figure as histogram_figure,
    trade_off_figure as trade_off_figure,
)
from .flow import (
    bent_grid_figure as bent_grid_figure,
    cell_areas as cell_areas,
    map_figure as map_figure,
    share_figure as share_figure,
    steps_figure as steps_figure,
    trajectory_figure as trajectory_figure,
)
from .velocity import velocity_figure as velocity_figure
