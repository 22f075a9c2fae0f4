"""What exit codes say besides 0, all is well, and those of errors (`BrrpError.exit_code`)."""

SOME_FAILED = 3  # of many objects, scenes or meshes; the others are written
