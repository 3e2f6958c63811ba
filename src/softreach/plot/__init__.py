"""The figures of softreach: they take data and draw it.

What draws one panel takes `ax=None` and returns the axes; what draws several returns the figure.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
