"""Studies: many scans, from BIDS or from files, to surfaces in the layout that the next program expects.

:func:`read_subjects` reads the table of a study, one row for each participant and session. Its columns are described
in ``subjects.json`` beside it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
