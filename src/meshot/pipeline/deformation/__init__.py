"""Flows from initial surfaces to white surfaces: the network's use, its data and its training."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
