"""Many trainings of an experiment: one after another or side by side, each alone in its folder, and what is kept."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
