"""Many runs side by side: on this computer's cores or a cluster's, results on disk as they come, the same whoever works."""

from rigtwin.studies.sweep.store import Store
from rigtwin.studies.sweep.sweep import swept
from rigtwin.studies.sweep.workers import Workers, each, hired

__all__ = ["Store", "Workers", "each", "hired", "swept"]
