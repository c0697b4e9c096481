"""Systems that find surfaces in a scan. They share one protocol and are selected by name.

A system is a subclass of :class:`SurfaceSystem` with a ``name`` in a file of this folder, or an entry point of the
group ``meshot.systems``. No other code uses its name. Its configurations are in ``settings/NAME``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
