"""Pictures of volumes and surfaces: slices, static images, and interactive 3D views.

Used by the report of a reconstruction and by the book. The interactive view is one piece of HTML that needs no network.
Colours and line styles of the book are here, too.
"""

import lazy_loader

from meshot.extras import needing

with needing("cortex"):
    import matplotlib  # noqa: F401

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
