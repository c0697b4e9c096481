from .analytic import (
    Affine as Affine,
    AnalyticField as AnalyticField,
    Push as Push,
    Vortex as Vortex,
    rotation as rotation,
    shear as shear,
    spiral as spiral,
)
from .field import (
    LearnedVelocity as LearnedVelocity,
    Prepared as Prepared,
    Velocity as Velocity,
    VelocityField as VelocityField,
    euler_is_injective as euler_is_injective,
)
from .grid import GridVelocity as GridVelocity, grid_around as grid_around
from .network import NetworkVelocity as NetworkVelocity
from .spline import spline_values as spline_values
from .storage import (
    quantised_velocity as quantised_velocity,
    read_velocity as read_velocity,
    write_velocity as write_velocity,
)
