"""Search a building's roof as a union of parametric volumes.

Structure must be worth its price in points. The roof is

    z(x, y) = max over volumes whose rectangle contains (x, y)  of  min over its at most five planes

plan        the building's frame, the points that count, cells where none may be seen
depth       how deep inside the outline places lie
directions  in which volumes may lie
allowed     the shapes that volumes may have
whole       these together: a building as it is searched
blocks      where a large one is cut
scene       a block in each of the directions, as the compiled search reads it
planes      compiled: planes and gables that explain rectangles of points
candidates  volumes made of these planes, and where each would gain most
volumes     compiled: a volume as a row of numbers, and the heights of a roof
around      compiled: the heights that the other volumes leave for one
objective   compiled: the cost of a roof: misfit, volumes, edges on lines of their own
edges       compiled: moves of a volume's edges
refit       compiled: least squares for a volume's planes
moves       compiled: moves that change one volume
facings     compiled: moves that turn its planes
improve     compiled: all moves in turn
add, grow   volumes added one by one to a level base, and the first one grown anew
search      these in order, block by block
fit         the outcome
"""
