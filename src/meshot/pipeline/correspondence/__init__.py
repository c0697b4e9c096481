"""Vertices that correspond between people.

:func:`carry_template` carries the white surface of fsaverage5 to the white surface of one person by fitted flows.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
