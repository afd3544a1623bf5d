"""Models in the browser: a run as 3D Tiles, and a page without network for this machine alone."""
