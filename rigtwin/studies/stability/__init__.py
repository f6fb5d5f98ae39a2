"""Stability of a hybrid test whose motor and cylinder answer late: models, exact critical lags and
delays, maps."""
