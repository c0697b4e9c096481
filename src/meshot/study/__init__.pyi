from .quality_page import QUALITY_PAGE as QUALITY_PAGE, write_quality_page as write_quality_page
from .subjects_table import (
    DICTIONARY as DICTIONARY,
    TABLE as TABLE,
    read_subjects as read_subjects,
    write_subjects as write_subjects,
)
