"""Cohorts of synthetic subjects on disk: recipes, generation, manifests, reading.

A recipe and a seed determine every subject. Generation can be resumed. A manifest shows which files have changed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
