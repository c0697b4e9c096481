from .carrying import deformed as deformed, standardised as standardised
from .data import DeformationExample as DeformationExample, hemisphere_example as hemisphere_example
from .example_file import read_example as read_example, write_example as write_example
from .settings import (
    DeformationConfig as DeformationConfig,
    DeformationSettings as DeformationSettings,
    deformation_config as deformation_config,
)
from .system import DeformationSystem as DeformationSystem
from .training import train_deformation as train_deformation
