"""Geometry that several packages use. It imports no values of hiproof.

rings               polygons repaired and oriented, edges and area vectors of rings
outline_edges       the edges of an outline, and strips beside them
point_in_polygon    whether a point lies in rings, compiled
components          which members of a set are connected by links
grid                cells of a grid in plan, numbered
alpha_shape         the outline of a set of points
thin                one point a cell
point_grid          which points lie in which polygon
arrays              sorting and copying in compiled code
flat_shell          the rings of a closed shell as arrays
"""
