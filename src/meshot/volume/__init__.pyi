from .io import read_volume as read_volume, write_volume as write_volume
from .masking import masked_scan as masked_scan
from .pyramid import volume_pyramid as volume_pyramid
from .registration import register_affine as register_affine
from .sampling import cropped as cropped, sample_volume as sample_volume
from .standard import (
    StandardScan as StandardScan,
    centre_of_mass as centre_of_mass,
    place_on_grid as place_on_grid,
    standard_scan as standard_scan,
)
from .tissue import bright_volume as bright_volume, dice as dice, white_matter_probability as white_matter_probability
from .volume import (
    Volume as Volume,
    centre_ras as centre_ras,
    mm_to_voxel as mm_to_voxel,
    transform_points as transform_points,
    voxel_sizes as voxel_sizes,
    voxel_to_mm as voxel_to_mm,
)
