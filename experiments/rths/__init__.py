"""The benchmark of real-time hybrid simulation: a simulated building with one real column."""
