"""Many runs side by side, on the cores of this computer or of a cluster, with results on disk.

The results do not depend on who computes them.
"""

from rigtwin.studies.sweep.jobs import iterate_results, run_jobs
from rigtwin.studies.sweep.store import Store
from rigtwin.studies.sweep.workers import Workers, open_workers

__all__ = ["Store", "Workers", "iterate_results", "open_workers", "run_jobs"]
