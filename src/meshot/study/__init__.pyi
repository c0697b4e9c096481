from .bids import Choice as Choice, missing_participants as missing_participants, visits_of_bids as visits_of_bids
from .compare_files import find_surfaces as find_surfaces, paired_surfaces as paired_surfaces
from .compare_output import COMPARISON_PAGE as COMPARISON_PAGE, write_comparison as write_comparison
from .many_visits import reconstruct_study as reconstruct_study, write_table as write_table
from .one_visit import StudySettings as StudySettings
from .quality_page import QUALITY_PAGE as QUALITY_PAGE, write_quality_page as write_quality_page
from .subjects_table import (
    DICTIONARY as DICTIONARY,
    TABLE as TABLE,
    read_subjects as read_subjects,
    write_subjects as write_subjects,
)
from .visits import (
    DESCRIPTION as DESCRIPTION,
    Visit as Visit,
    visits_of_files as visits_of_files,
    visits_of_folder as visits_of_folder,
)
