from .carrying import deformed as deformed, standardised as standardised
from .data import DeformationExample as DeformationExample, InitialSurfaces as InitialSurfaces
from .example_file import read_example as read_example, write_example as write_example
from .files import run_deformation_training as run_deformation_training
from .settings import (
    DeformationConfig as DeformationConfig,
    DeformationSettings as DeformationSettings,
    deformation_config as deformation_config,
    read_deformation_config as read_deformation_config,
)
from .training import train_deformation as train_deformation
