"""Many runs side by side: on this computer's cores or a cluster's, results on disk as they come.

Whoever works, the results are the same.
"""

from rigtwin.studies.sweep.jobs import iterate_results, run_jobs
from rigtwin.studies.sweep.store import Store
from rigtwin.studies.sweep.workers import Workers, open_workers

__all__ = ["Store", "Workers", "iterate_results", "open_workers", "run_jobs"]
