"""Branches of the inverse: starting points, Newton's method, folds."""
