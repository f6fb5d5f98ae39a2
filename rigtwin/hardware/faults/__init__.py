"""Fault injection: sessions on the virtual card with a fault, to test that the rig stops in time."""
