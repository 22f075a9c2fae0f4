"""Rendering: pictures of meshes by ray casting, and the preview of a result."""
