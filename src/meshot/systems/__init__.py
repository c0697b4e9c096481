"""Systems that find surfaces in a scan. They share one protocol and are selected by name.

A system is a package in this folder with a class ``System``, or an entry point of the group ``meshot.systems``. No code
outside a system's folder uses its name. ``deformation`` is not a system: it contains the common code of systems that
deform initial surfaces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
