"""What simulators and motion planners read: convex parts, URDF, MJCF, a cuRobo world."""
