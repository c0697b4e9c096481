from .distance import signed_distance as signed_distance
from .genus import filled_cavities as filled_cavities
from .genus import genus_zero as genus_zero
from .genus import largest_component as largest_component
from .marching_cubes import isosurface as isosurface
from .marching_cubes import separated_field as separated_field
from .voxelise import (
    enclosed_fractions as enclosed_fractions,
)
from .voxelise import (
    voxel_distance as voxel_distance,
)
from .voxelise import (
    winding_numbers as winding_numbers,
)
