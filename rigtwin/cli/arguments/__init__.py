"""What each command takes. Parsing only, so that help is instant."""
