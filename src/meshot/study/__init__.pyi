from .bids import (
    DESCRIPTION as DESCRIPTION,
    Choice as Choice,
    Visit as Visit,
    missing_participants as missing_participants,
    visits_of_bids as visits_of_bids,
    visits_of_files as visits_of_files,
    visits_of_folder as visits_of_folder,
)
from .comparison import (
    COMPARISON_PAGE as COMPARISON_PAGE,
    find_surfaces as find_surfaces,
    paired_surfaces as paired_surfaces,
    write_comparison as write_comparison,
)
from .layouts import LAYOUTS as LAYOUTS, Layout as Layout, layout_named as layout_named
from .many_visits import (
    StudySettings as StudySettings,
    reconstruct_study as reconstruct_study,
    write_table as write_table,
)
from .quality import (
    DICTIONARY as DICTIONARY,
    QUALITY_PAGE as QUALITY_PAGE,
    TABLE as TABLE,
    read_subjects as read_subjects,
    write_quality_page as write_quality_page,
    write_subjects as write_subjects,
)
