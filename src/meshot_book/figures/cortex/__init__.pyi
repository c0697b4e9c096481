from .panels import compared_slices as compared_slices, slice_panels as slice_panels
from .systems import (
    SystemStep as SystemStep,
    count_weights as count_weights,
    network_figure as network_figure,
    system_figure as system_figure,
    system_steps as system_steps,
)
