"""Methods: each takes a Frame and gives, for each object, occupancy probability at points."""
