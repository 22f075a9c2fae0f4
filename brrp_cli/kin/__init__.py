"""Stored shapes, stretched, as what an object may be that the prior does not hold."""
