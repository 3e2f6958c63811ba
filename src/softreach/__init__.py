"""softreach: where a soft slender robot can go.

From a design (a tapered arm with contractile fibers) to its reachability cloud, its reachable
volume and its blind spots. Public names load at first use, so that importing softreach costs
nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
