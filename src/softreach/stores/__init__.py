"""Zarr stores that notice damage: checksums of every file, and one way in and out."""
