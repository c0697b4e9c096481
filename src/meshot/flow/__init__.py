"""Flow maps: velocity fields integrated over time, and what is fitted with them.

:func:`integrate` carries points along a field, forwards or backwards. Smaller rooms: ``fields`` (velocity fields),
``fitting`` (the field whose flow carries one mesh to another), ``crossings`` (faces that cross, and their repair).
This is the only room that imports torchdiffeq.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
