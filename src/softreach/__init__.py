"""softreach: where a soft slender robot can go.

From a design (a tapered arm with contractile fibers) to its reachability cloud, its reachable
volume and its blind spots. Public names load at first use, so that importing softreach costs
nothing.
"""

import lazy_loader

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """A public name, loaded at its first use."""
    if name in __all__:
        return _public(name)
    if name == "__version__":
        from importlib.metadata import version

        return version("softreach")
    from softreach.support.errors import did_you_mean

    hint = did_you_mean(name, __all__)
    message = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(f"{message}; {hint}" if hint else message)
