from .compared import compared_slices as compared_slices
from .network import network_figure as network_figure
from .panels import slice_panels as slice_panels
from .system_rows import count_weights as count_weights, system_steps as system_steps
from .systems import SystemStep as SystemStep, system_figure as system_figure
