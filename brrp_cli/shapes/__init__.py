"""Parametric household shapes in real sizes: closed, outward meshes that need no download."""
