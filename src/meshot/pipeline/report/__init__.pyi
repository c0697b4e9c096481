from .exchange import (
    TEMPLATE as TEMPLATE,
    itk_transform as itk_transform,
    lta_transform as lta_transform,
    white_matter_labels as white_matter_labels,
)
from .files import (
    OVERVIEW as OVERVIEW,
    PAGE as PAGE,
    REPORT as REPORT,
    SHORT as SHORT,
    structure_of as structure_of,
    write_flat as write_flat,
    write_found as write_found,
    write_reconstruction as write_reconstruction,
)
from .numbers import seconds_by_stage as seconds_by_stage
