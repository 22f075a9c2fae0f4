"""Ground truth: scenes with known objects, exact meshes, metrics of shape."""
