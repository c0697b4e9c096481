from .distance import signed_distance as signed_distance
from .genus import filled_cavities as filled_cavities, genus_zero as genus_zero, largest_component as largest_component
from .marching_cubes import isosurface as isosurface, separated_field as separated_field
from .voxelise import (
    enclosed_fractions as enclosed_fractions,
    voxel_distance as voxel_distance,
    winding_numbers as winding_numbers,
)
from .watershed import watershed_regions as watershed_regions
