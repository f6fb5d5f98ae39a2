"""Where the twin and a recording disagree: component replays, and what noise alone would leave of
them."""
