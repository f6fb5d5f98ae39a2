"""Fault injection: sessions with a fault on the virtual card, which must stop the rig in time."""
