"""Functions that all chapters use: numbers with four digits, tables, the card of the environment."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
