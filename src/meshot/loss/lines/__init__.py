"""Transport on a line, and what a mesh becomes when it is projected on one.

The monotone plan between two weighted sets of numbers, and the projected distribution of a surface: its atoms, density
and distribution function. The losses use faster code; this is the code to read.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
