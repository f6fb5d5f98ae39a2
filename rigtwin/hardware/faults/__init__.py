"""Faults put into a session on the virtual card: is the rig stopped in time and rightly?"""
