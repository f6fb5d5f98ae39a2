"""What tests share and cannot have as a fixture. No tests in here."""
