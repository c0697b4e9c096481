"""Where the files of a study stand: flat folders, FreeSurfer's SUBJECTS_DIR, or BIDS derivatives."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
