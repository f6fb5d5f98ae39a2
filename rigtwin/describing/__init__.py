"""A machine's description and the map of a log, made from the model and the columns of the log."""
