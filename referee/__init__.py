"""The withheld-effect check: a referee's rig of its own, a diagnosis that sees files alone, and the
score of both."""
