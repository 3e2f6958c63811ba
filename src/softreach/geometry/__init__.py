"""Points to numbers; nothing here knows a robot."""
