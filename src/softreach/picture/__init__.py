"""Pixels from points and triangles in NumPy alone: views, light, a z-buffer, web pages."""
