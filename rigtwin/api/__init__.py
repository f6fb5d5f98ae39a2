"""Functions that `import rigtwin` offers. The command line calls these functions only."""
