from .network import network_figure as network_figure
from .panels import slice_panels as slice_panels
