from .carrying import deformed as deformed
from .carrying import standardised as standardised
from .data import DeformationExample as DeformationExample
from .data import hemisphere_example as hemisphere_example
from .example_file import read_example as read_example
from .example_file import write_example as write_example
from .settings import (
    DeformationConfig as DeformationConfig,
)
from .settings import (
    DeformationSettings as DeformationSettings,
)
from .settings import (
    deformation_config as deformation_config,
)
from .system import DeformationSystem as DeformationSystem
from .training import train_deformation as train_deformation
