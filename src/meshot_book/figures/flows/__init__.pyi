from .crossing import crossing_player as crossing_player
from .crossing import outlines as outlines
from .crossing import two_triangles as two_triangles
from .deformation import deformation_view as deformation_view
from .deformation_charts import (
    arms_figure as arms_figure,
)
from .deformation_charts import (
    histogram_figure as histogram_figure,
)
from .deformation_charts import (
    trade_off_figure as trade_off_figure,
)
from .flow import (
    bent_grid_figure as bent_grid_figure,
)
from .flow import (
    cell_areas as cell_areas,
)
from .flow import (
    map_figure as map_figure,
)
from .flow import (
    share_figure as share_figure,
)
from .flow import (
    steps_figure as steps_figure,
)
from .flow import (
    trajectory_figure as trajectory_figure,
)
from .velocity import velocity_figure as velocity_figure
