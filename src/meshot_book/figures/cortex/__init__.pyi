from .kept_slices import (
    KeptSlice as KeptSlice,
    cut_slice as cut_slice,
    kept_slices_figure as kept_slices_figure,
    live_numbers as live_numbers,
    live_slices as live_slices,
    read_slices as read_slices,
    write_slices as write_slices,
)
from .panels import compared_slices as compared_slices, slice_panels as slice_panels
from .systems import (
    SystemStep as SystemStep,
    count_weights as count_weights,
    network_figure as network_figure,
    system_figure as system_figure,
    system_steps as system_steps,
)
