"""Triangles for viewers and pages.

viewed       a building as viewers draw it
triangles    faces cut into triangles, also packed for a page's JavaScript
glb, gltf    binary glTF 2.0, its container and its content
obj          Wavefront OBJ
stl          binary STL
ifc          IFC4X3
dxf          DXF, for CAD
rhino        3DM, for Rhino
tiles        3D Tiles 1.1
"""
