"""Studies of the thesis: its printed results compared with the twin or with a closed form."""
