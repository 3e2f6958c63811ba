"""What is computed at its first use, without a lock, and types of what is imported then."""

from functools import cached_property
from typing import TYPE_CHECKING, Any, ForwardRef

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import DataArray, Dataset

    lazy = cached_property
else:
    Axes, Figure = ForwardRef("matplotlib.axes.Axes"), ForwardRef("matplotlib.figure.Figure")
    DataFrame, DataArray = ForwardRef("pandas.DataFrame"), ForwardRef("xarray.DataArray")
    Dataset = ForwardRef("xarray.Dataset")

    class lazy(cached_property):
        """As `functools.cached_property`, which in Python 3.11 has one lock for all objects.

        Threads that ask different arms would wait for each other. Here two threads that ask the
        same object at once may both compute it.
        """

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            if instance is None:
                return self
            value = instance.__dict__[self.attrname] = self.func(instance)
            return value
