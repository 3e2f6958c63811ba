"""From points to numbers; nothing here is about robots."""
