"""Jobs of a session, one file a feature: what follows from a change of its state."""
