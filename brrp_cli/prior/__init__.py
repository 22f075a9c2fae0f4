"""The prior, offline: from meshes to shards and a manifest."""
