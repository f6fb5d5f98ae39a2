"""Stability of a hybrid test whose motor and cylinder respond late.

The package has state-space models, exact critical lags and delays, and stability maps.
"""
