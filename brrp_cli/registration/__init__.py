"""Registration: pose and scale of a stored object that explain the observed points."""
