from .io import read_volume as read_volume
from .io import write_volume as write_volume
from .pyramid import volume_pyramid as volume_pyramid
from .registration import register_affine as register_affine
from .sampling import cropped as cropped
from .sampling import sample_volume as sample_volume
from .standard import (
    StandardScan as StandardScan,
)
from .standard import (
    centre_of_mass as centre_of_mass,
)
from .standard import (
    place_on_grid as place_on_grid,
)
from .standard import (
    standard_scan as standard_scan,
)
from .tissue import dice as dice
from .tissue import white_matter_probability as white_matter_probability
from .volume import (
    Volume as Volume,
)
from .volume import (
    centre_ras as centre_ras,
)
from .volume import (
    mm_to_voxel as mm_to_voxel,
)
from .volume import (
    transform_points as transform_points,
)
from .volume import (
    voxel_sizes as voxel_sizes,
)
from .volume import (
    voxel_to_mm as voxel_to_mm,
)
