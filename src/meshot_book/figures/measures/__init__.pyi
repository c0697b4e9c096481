from .cost import cost_figure as cost_figure
from .intervals import intervals_figure as intervals_figure, printed_figure as printed_figure
from .planted import Window as Window, ratio_figure as ratio_figure, sections_figure as sections_figure
from .planted_errors import PlantedState as PlantedState, planted_player as planted_player
from .projection import law_figure as law_figure, turned_densities_figure as turned_densities_figure
from .schematics import banks_figure as banks_figure, encodings_figure as encodings_figure, tree_figure as tree_figure
from .slopes import draw_slopes as draw_slopes
from .stepping import step_errors_figure as step_errors_figure
