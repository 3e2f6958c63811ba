"""ActiveFilaments.jl: filaments from JSON and as Julia source, and its clouds as headerless CSV.

[ActiveFilamentsJl] is the program of the theory's authors.
"""

from softreach.exchange.activefilaments.cloud import gamma_path, read_cloud, write_cloud
from softreach.exchange.activefilaments.filament import design_script, read_design

__all__ = ["design_script", "gamma_path", "read_cloud", "read_design", "write_cloud"]
