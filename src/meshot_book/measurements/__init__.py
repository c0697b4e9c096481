"""Measurements of surfaces in the experiments: names of the metrics, groups of rows, spreads and paired differences."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
