"""Triangles for viewers and pages.

viewed       a building as viewers draw it
triangles    faces cut into triangles
glb, gltf    binary glTF 2.0, its container and its content
obj          Wavefront OBJ
stl          binary STL
ifc          IFC4X3
dxf          DXF, for CAD
rhino        3DM, for Rhino
tiles        3D Tiles 1.1
page_mesh    a solid packed for a page's JavaScript
"""
