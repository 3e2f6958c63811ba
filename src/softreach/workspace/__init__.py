"""The reachable set as the image of the activation box: volume, multiplicity, folds, surface."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
