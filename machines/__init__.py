"""The machines that come along: a description each, maps for their data, and channel tables of
cards."""

DEFAULT_MACHINE = "suspension-rig"
"""Of recordings and commands that name none."""
