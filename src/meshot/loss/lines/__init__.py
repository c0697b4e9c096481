"""Transport on a line, and the distribution of a projected mesh on it.

The monotone plan between two weighted sets of numbers, and the projected distribution of a surface with its atoms,
density and distribution function. This code is written to be read; the losses use faster code.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
