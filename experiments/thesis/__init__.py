"""Studies of the thesis: what it prints, beside what the twin or a closed form gives."""
