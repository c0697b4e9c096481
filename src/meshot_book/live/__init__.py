"""Live figures: a question, plots that answer a reader's hand, and what was to be seen."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
