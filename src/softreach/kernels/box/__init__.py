"""Boxes of activations: bounds, projections and descents inside them."""
