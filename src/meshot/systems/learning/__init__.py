"""Common code of systems that learn: settings, templates, trainings and validation. Not a system."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
