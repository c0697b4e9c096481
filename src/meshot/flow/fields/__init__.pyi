from .analytic import (
    Affine as Affine,
)
from .analytic import (
    AnalyticField as AnalyticField,
)
from .analytic import (
    Push as Push,
)
from .analytic import (
    Vortex as Vortex,
)
from .analytic import (
    rotation as rotation,
)
from .analytic import (
    shear as shear,
)
from .analytic import (
    spiral as spiral,
)
from .field import (
    LearnedVelocity as LearnedVelocity,
)
from .field import (
    Prepared as Prepared,
)
from .field import (
    Velocity as Velocity,
)
from .field import (
    VelocityField as VelocityField,
)
from .field import (
    euler_is_injective as euler_is_injective,
)
from .grid import GridVelocity as GridVelocity
from .grid import grid_around as grid_around
from .network import NetworkVelocity as NetworkVelocity
from .spline import spline_values as spline_values
from .storage import (
    quantised_velocity as quantised_velocity,
)
from .storage import (
    read_velocity as read_velocity,
)
from .storage import (
    write_velocity as write_velocity,
)
