"""Meshes: shapes and Gmsh files, and their points, vertices and parts."""
