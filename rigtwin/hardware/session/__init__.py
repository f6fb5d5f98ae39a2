"""Session on the rig: dry run, permission, recording, guardian, and the operator's stop."""
