from .scans import example_data as example_data, scaled_image as scaled_image
from .settings import (
    FlowTrainingSettings as FlowTrainingSettings,
    LearningSettings as LearningSettings,
    completed_groups as completed_groups,
)
from .surfaces import (
    SURFACES as SURFACES,
    checked_surfaces as checked_surfaces,
    surfaces_of_sides as surfaces_of_sides,
)
from .template import (
    Template as Template,
    TemplateSettings as TemplateSettings,
    mean_box as mean_box,
    template_shape as template_shape,
)
from .training import (
    mean_distances as mean_distances,
    train_on_subjects as train_on_subjects,
    train_part as train_part,
)
