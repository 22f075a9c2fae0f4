"""PointSDF, the learned baseline: a network from a seen cloud to occupancy."""
