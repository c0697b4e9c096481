from .line import (
    cells_figure as cells_figure,
    distribution_figure as distribution_figure,
    draw_pairing as draw_pairing,
    pairs_of as pairs_of,
)
from .sorting import sorting_player as sorting_player
from .turned_line import turning_player as turning_player
