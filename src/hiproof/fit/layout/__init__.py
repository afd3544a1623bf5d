"""Lay out what the roof of a building is fitted to.

plan        the building's frame, the points that count, cells where none may be seen
outline     an outline for a building that comes without one
depth       how deep inside the outline places lie
directions  in which volumes may lie
whole       these together, with the shapes that volumes may have
blocks      parts of a large building, each as if it were one
scene       a window on it in each of the directions, as compiled code reads it
"""
