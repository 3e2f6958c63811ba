"""The parts of the report; each takes the sizes, the folder and a notebook to write in."""
