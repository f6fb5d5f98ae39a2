"""The law of every component against an equation that the test writes out itself."""
