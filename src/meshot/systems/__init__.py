"""Systems: ways from a scan to surfaces, behind one protocol, found by name.

A system is a package in this folder with a class ``System``, or an entry point of the group ``meshot.systems``. Nothing
outside a system's own folder knows its name. ``deformation`` is no system, but what those that deform initial surfaces
share.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
