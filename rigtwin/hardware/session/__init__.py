"""A test on the rig from the dry run to the recording: who keeps it, who watches, how the operator stops it."""
