"""Exercises and their checkers: each tries a reader's function and answers with a hint."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
