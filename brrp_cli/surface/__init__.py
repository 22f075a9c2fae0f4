"""Surfaces: meshes, pictures and files of a reconstruction."""
