from .line import (
    cells_figure as cells_figure,
    distribution_figure as distribution_figure,
    draw_pairing as draw_pairing,
    pairing_figure as pairing_figure,
    pairs_of as pairs_of,
    turning_figure as turning_figure,
)
