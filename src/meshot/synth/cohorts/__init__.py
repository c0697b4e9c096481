"""Cohorts of synthetic subjects on disk: recipes, making, manifests, reading.

A recipe and a seed name every subject. A cohort that was stopped goes on, and a manifest says which files have changed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
