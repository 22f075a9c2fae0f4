"""PointSDF, a learned baseline: a network from a seen cloud to occupancy; weights, training."""
