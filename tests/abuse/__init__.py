"""Hostile input: a case is a line of a table, with what softreach says of it."""
