"""Independent answers, in NumPy and SciPy alone, that the library is held to."""
