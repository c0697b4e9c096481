"""Figures and players of flows and of deforming meshes: chapters 12 and 14."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
