"""Scene of a tab: camera, clouds, arm and what is dragged, drawn through viser."""
