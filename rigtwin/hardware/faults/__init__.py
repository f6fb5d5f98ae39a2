"""Faults put into a session on the virtual card, to see that the rig is stopped, in time and for the right reason."""
