"""What the numbers of each part say about the paper's statements, one short function each."""
