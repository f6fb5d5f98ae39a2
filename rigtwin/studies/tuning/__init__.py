"""Tuning of controller settings on the twin, before the rig is touched."""
