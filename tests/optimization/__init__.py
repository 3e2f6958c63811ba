"""Laws of the search of designs."""
