"""Settings tuned on the twin before the rig is touched."""
