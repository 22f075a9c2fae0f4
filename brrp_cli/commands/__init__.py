"""One small file for each command: parse, call, print."""
