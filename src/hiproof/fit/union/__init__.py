"""Search a building's roof as a union of parametric volumes.

Structure must be worth its price in points. The roof is

    z(x, y) = max over volumes whose rectangle contains (x, y)  of  min over its at most five planes

plan        the building's frame, the points that count, a grid, the unobserved cells
allowed     the shapes that volumes may have
scene       these in each of the building's directions, as the compiled search reads them
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
add, grow   volumes added one by one to a level base, and the first of them grown anew
trim        hidden edges drawn in
search      these in order
large       roofs of more than 200 m2, each block of which is searched as a house
whole       what blocks need of a whole roof
window      the scene of a box
blocks      where a large roof is cut
fit         the outcome
"""
