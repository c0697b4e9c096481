"""Figures of losses on points: chapters 01, 03 and 04."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
