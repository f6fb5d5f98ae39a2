"""The benchmark of real-time hybrid simulation: a building whose first column is real."""
