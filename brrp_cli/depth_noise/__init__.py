"""Simulated noise of depth cameras: what a sensor makes of exact depth."""
