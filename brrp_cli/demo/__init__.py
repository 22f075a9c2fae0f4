"""The embedded default: a prior and a scene that the project's own code makes, offline."""
