from .io import (
    read_volume as read_volume,
    read_volume_and_facts as read_volume_and_facts,
    volume_facts as volume_facts,
    write_volume as write_volume,
)
from .registration import (
    StandardScan as StandardScan,
    averaged_scan as averaged_scan,
    centre_of_mass as centre_of_mass,
    place_on_grid as place_on_grid,
    register_affine as register_affine,
    standard_scan as standard_scan,
    with_dark_background as with_dark_background,
)
from .surfaces import (
    enclosed_fractions as enclosed_fractions,
    filled_cavities as filled_cavities,
    filled_tunnels as filled_tunnels,
    genus_zero as genus_zero,
    isosurface as isosurface,
    largest_component as largest_component,
    separated_field as separated_field,
    signed_distance as signed_distance,
    voxel_distance as voxel_distance,
    watershed_regions as watershed_regions,
    winding_numbers as winding_numbers,
)
from .volume import (
    Volume as Volume,
    bright_volume as bright_volume,
    centre_ras as centre_ras,
    cropped as cropped,
    dice as dice,
    masked_scan as masked_scan,
    mm_to_voxel as mm_to_voxel,
    resample as resample,
    sample_volume as sample_volume,
    transform_points as transform_points,
    volume_pyramid as volume_pyramid,
    voxel_sizes as voxel_sizes,
    voxel_to_mm as voxel_to_mm,
    white_matter_probability as white_matter_probability,
)
