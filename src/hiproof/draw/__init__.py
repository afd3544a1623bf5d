"""Pictures of models: in notebooks, in plots, and of every roof type.

view          how a solid is seen: faces turned, projected, ordered from far to near
html          a notebook's view, which turns
plot          a building over its points, by matplotlib
objects       buildings as objects of trimesh, pyvista and geopandas
primitives    the figure of every roof type
"""
