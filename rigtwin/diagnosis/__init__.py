"""Disagreement of the twin and a recording: component replays, and what noise alone would leave of
them."""
