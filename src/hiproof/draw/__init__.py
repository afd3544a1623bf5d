"""Pictures of models: a view for notebooks without network, a plot over points, every primitive
with its parameters' names.

view          how a solid is seen: faces turned, projected, ordered from far to near
html          a notebook's view, which turns
plot          a building over its points, by matplotlib
primitives    the figure of every roof type
"""
