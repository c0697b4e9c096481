"""What every chapter begins and ends with: numbers in four digits, tables, the environment card."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
