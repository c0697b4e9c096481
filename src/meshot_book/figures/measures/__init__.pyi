from .planted import (
    Window as Window,
    ratio_figure as ratio_figure,
    round_length as round_length,
    sections_figure as sections_figure,
)
from .projection import law_figure as law_figure, turned_densities_figure as turned_densities_figure
from .schematics import banks_figure as banks_figure, encodings_figure as encodings_figure, tree_figure as tree_figure
from .slopes import (
    cost_figure as cost_figure,
    draw_slopes as draw_slopes,
    intervals_figure as intervals_figure,
    printed_figure as printed_figure,
    step_errors_figure as step_errors_figure,
)
