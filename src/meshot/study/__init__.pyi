from .subjects_table import (
    DICTIONARY as DICTIONARY,
    TABLE as TABLE,
    read_subjects as read_subjects,
    write_subjects as write_subjects,
)
