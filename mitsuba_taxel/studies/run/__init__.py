"""Execution of studies: jobs, processes, pilot runs, results."""
