"""Propose volumes that points suggest.

planes   compiled: planes and gables that explain rectangles of points
listing  volumes made of these planes, and where each would gain most
volumes  compiled: a volume as a row of numbers
allowed  the shapes that volumes may have
"""
