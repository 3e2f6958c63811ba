"""Errors, arguments, arrays, threads, files: what every room rests on."""
