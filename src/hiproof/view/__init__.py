"""Models in the browser: a run as 3D Tiles, and a page that shows them without a network."""
