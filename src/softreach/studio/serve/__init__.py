"""Server of the studio: who may connect, how it starts, and fixes of viser."""
