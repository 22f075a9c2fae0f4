"""Building a prior, offline: from mesh files to shards and a manifest."""
