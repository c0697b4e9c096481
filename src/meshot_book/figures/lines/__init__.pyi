from .line import (
    cells_figure as cells_figure,
)
from .line import (
    distribution_figure as distribution_figure,
)
from .line import (
    draw_pairing as draw_pairing,
)
from .line import (
    pairs_of as pairs_of,
)
from .sorting import sorting_player as sorting_player
from .turned_line import turning_player as turning_player
