"""What a user asks of an arm: places, regions, bounds; met or missed, and by how much."""
