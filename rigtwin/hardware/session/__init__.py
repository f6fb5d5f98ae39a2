"""A test on the rig from the dry run to the recording.

Who keeps it, who watches, how the operator stops it.
"""
