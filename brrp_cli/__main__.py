"""`python -m brrp_cli` is `brrp`."""

from brrp_cli.cli import main

main(prog_name="brrp")
