"""Files that appear whole, are recognized, and notice damage."""
