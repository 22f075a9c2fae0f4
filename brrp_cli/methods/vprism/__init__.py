"""V-PRISM, the baseline: one probabilistic multi-class map of the whole scene."""
