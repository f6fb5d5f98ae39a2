"""MJCF models of the machines; data only."""
