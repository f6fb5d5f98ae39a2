"""What `import rigtwin` offers. The commands of the command line call these functions and nothing
else."""
