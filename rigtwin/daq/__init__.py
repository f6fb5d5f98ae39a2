"""The rig behind a data acquisition card: which signal is on which line, volts, the card itself, and a virtual one."""
