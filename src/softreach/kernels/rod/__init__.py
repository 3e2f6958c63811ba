"""Free rods: tips, Jacobians and frames of many activations at a time."""
