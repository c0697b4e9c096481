from .correspondence import CarriedTemplate as CarriedTemplate, carry_template as carry_template
from .initial_surface import PROBABILITY_WEIGHT_MM as PROBABILITY_WEIGHT_MM, segmented_surface as segmented_surface
from .lobes import (
    LOBE_LIMITS as LOBE_LIMITS,
    LOBES as LOBES,
    doubts_in_words as doubts_in_words,
    doubts_of_lobes as doubts_of_lobes,
    lobe_numbers as lobe_numbers,
    template_places as template_places,
)
from .quality import (
    QualityWarning as QualityWarning,
    average_warnings as average_warnings,
    file_warnings as file_warnings,
    quality_numbers as quality_numbers,
    require_no_warnings as require_no_warnings,
)
from .reconstruction import (
    SEGMENTATION as SEGMENTATION,
    HemisphereSurface as HemisphereSurface,
    Progress as Progress,
    Reconstruction as Reconstruction,
    TrainedNetworks as TrainedNetworks,
    load_networks as load_networks,
    reconstruct as reconstruct,
    segmentation_weights as segmentation_weights,
)
from .regions import (
    region_numbers as region_numbers,
    vertex_regions as vertex_regions,
    write_regions as write_regions,
)
from .report import (
    FLAT_REGIONS as FLAT_REGIONS,
    OVERVIEW as OVERVIEW,
    PAGE as PAGE,
    REPORT as REPORT,
    SHORT as SHORT,
    TEMPLATE as TEMPLATE,
    itk_transform as itk_transform,
    lta_transform as lta_transform,
    seconds_by_stage as seconds_by_stage,
    structure_of as structure_of,
    white_matter_labels as white_matter_labels,
    write_flat as write_flat,
    write_found as write_found,
    write_reconstruction as write_reconstruction,
)
from .segmentation import (
    SegmentationConfig as SegmentationConfig,
    example as example,
    in_scanner as in_scanner,
    reduced_volume as reduced_volume,
    run_segmentation_training as run_segmentation_training,
    segment as segment,
    train_segmentation as train_segmentation,
)
from .training import InitialSurfaces as InitialSurfaces, run_system_training as run_system_training
from .training_files import LOG as LOG, RECORD as RECORD, STATE_FOLDER as STATE_FOLDER, WEIGHTS as WEIGHTS
