"""Image of the activation box: its cells, its critical triangles, what they cover."""
