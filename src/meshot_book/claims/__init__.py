"""The claims of the paper: verdicts computed from committed results, and the ledger's page."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
